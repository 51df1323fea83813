"""Projectors and cameras planned together, after the plan that takes one by one."""
