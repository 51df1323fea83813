"""Tables of rig files that stand alone: patterns, sensor heads, turntables."""
