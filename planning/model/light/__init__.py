"""What light does to the edges of a plan: blur, grey levels, noise. Values only."""
