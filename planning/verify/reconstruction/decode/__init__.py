"""From images to edges, rings and points."""
