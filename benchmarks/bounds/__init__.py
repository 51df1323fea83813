"""Bounds over all poses, and attacks on them."""
