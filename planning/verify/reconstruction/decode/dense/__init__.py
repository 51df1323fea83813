"""Images of coded pixels to points: Gray code, phase, and two rays that meet."""
