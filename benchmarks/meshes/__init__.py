"""Readers, rays, curvature and regions."""
