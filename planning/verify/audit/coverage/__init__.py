"""Claims about areas."""
