"""Rig files: devices, limits and workspace as a user writes them, turned into SI."""
