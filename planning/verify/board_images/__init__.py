"""Images of a board that calibrate a planned rig well enough, and what they leave."""
