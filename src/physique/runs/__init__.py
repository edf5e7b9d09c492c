"""A run and its folder, and how good it is in numbers."""
