"""Section VI of the paper: the fewest cameras, and where they stand."""
