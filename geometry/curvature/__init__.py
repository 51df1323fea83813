"""Principal curvatures at a physical scale."""
