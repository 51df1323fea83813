"""Claims about rings."""
