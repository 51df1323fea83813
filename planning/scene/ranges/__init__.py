"""An object of which only a few points are known."""
