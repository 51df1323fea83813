"""Many parts, one after the other or side by side."""
