"""What `plan verify`, `accept`, `reconstruct` and `tolerance` do."""
