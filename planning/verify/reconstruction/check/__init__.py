"""Clouds merged and held against the mesh."""
