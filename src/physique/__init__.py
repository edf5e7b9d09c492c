"""Physics-based motion retargeting onto real human body shapes."""
