"""Exact searches for partial covers."""
