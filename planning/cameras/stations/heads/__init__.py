"""Sensor heads: where rigid groups of devices stand, and how few are enough."""
