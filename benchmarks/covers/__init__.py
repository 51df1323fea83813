"""Set covers, beside other solvers."""
