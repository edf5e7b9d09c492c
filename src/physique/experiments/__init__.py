"""The paper's section 5, one file an experiment: `python -m physique.experiments.NAME`."""
