"""What looks wrong where a check fails."""
