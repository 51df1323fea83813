"""Cleaning and orienting raw triangles."""
