"""Projectors and cameras chosen together, where each is worth what the other allows."""
