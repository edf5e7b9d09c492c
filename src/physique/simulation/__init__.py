"""The only place that steps MuJoCo: the character, its states, roll-outs and derivatives."""
