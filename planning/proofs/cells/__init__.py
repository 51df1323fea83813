"""Cells of device poses, each with a superset of what is covered from inside it."""
