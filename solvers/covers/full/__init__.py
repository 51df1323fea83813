"""Exact searches for covers of every row."""
