"""Meshes laid over each other."""
