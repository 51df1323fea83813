"""Fewest devices over the candidates and over all poses, and what proves it."""
