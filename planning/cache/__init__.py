"""What was computed before and depends on nothing that has changed."""
