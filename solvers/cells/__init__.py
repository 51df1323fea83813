"""Lower bounds on counts over cells of poses."""
