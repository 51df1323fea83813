"""Parts of a plan's document."""
