"""Good covers fast, without proof."""
