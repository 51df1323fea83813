"""Dominant regions: the most curved surface in pieces."""
