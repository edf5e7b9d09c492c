"""Controllers that keep performing a motion when they are pushed (section 4)."""
