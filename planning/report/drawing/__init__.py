"""`rig.png`: the planned rig in one picture."""
