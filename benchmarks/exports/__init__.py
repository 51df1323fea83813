"""Exports read back by the other side's own code."""
