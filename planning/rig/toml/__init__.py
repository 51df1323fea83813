"""Rig files as they are written: found, laid over presets and devices, checked."""
