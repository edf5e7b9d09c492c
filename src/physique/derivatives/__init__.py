"""The derivatives of a simulated step, in closed form and compiled loops."""
