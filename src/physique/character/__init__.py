"""The body as a MuJoCo model: hinges, strength, servos, states, and what its poses look like."""
