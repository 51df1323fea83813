"""Section III of the paper: the fewest projectors, and their poses."""
