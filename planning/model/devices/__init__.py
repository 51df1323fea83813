"""Devices as planned: bodies, poses, heads, and how far off they may stand."""
