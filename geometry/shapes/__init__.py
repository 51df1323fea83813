"""Closed-form shapes, boxes, spheres."""
