"""Areas and figures that a plan claims, recomputed on fresh samples."""
