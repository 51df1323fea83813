"""Open directions of samples as cells of cube maps."""
