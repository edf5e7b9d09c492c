"""Runs as one HTML page to look at and to mail."""
