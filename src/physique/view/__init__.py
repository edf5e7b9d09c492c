"""Pages to look at runs with."""
