"""Whole plans, and the stages that make them."""
