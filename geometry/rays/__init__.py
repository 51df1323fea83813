"""Rays, occlusion, closest points."""
