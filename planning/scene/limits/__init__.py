"""Limits of projectors, cameras and pairs: a class each, in the order they are tried.

The order of `PROJECTOR_LIMITS`, `CAMERA_LIMITS` and `PAIR_LIMITS` is that in which a
sample comes through them; the first that fails is its cause.
"""
