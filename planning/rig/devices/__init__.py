"""Devices of a rig file: optics, models, those that stand, and how they suit."""
