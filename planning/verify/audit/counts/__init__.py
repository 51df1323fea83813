"""Claims about counts, bounds and tables."""
