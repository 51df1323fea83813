"""Fronts of numbers of devices: `plan --pareto`, and `--take`."""
