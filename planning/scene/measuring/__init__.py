"""What cameras see, and what they measure with the projectors that light it."""
