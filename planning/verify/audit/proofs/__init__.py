"""Bounds over the candidates, checked from the certificates beside the plan."""
