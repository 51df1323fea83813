"""Cameras alone: what pairs of them measure, the fewest, and what is proved of them."""
