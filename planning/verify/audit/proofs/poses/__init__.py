"""Bounds over all poses, derived again by cells of the audit's own."""
