"""WHO performs: a person's mesh, its capsules and its masses. Never imports MuJoCo."""
