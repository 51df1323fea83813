"""Smaller covers, and bounds on them from multipliers and programs."""
