"""What is measured of rig files: presets, and files that were damaged."""
