"""The only place that steps MuJoCo."""
