"""A second sequence of rings, from where the first one found the surface bent."""
