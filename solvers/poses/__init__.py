"""Smooth programs over poses: margins, ring axes, baselines."""
