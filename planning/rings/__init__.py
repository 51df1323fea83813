"""Section IV of the paper: ring axes and radii."""
