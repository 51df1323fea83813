"""Devices, stations and zones as lines for who mounts them."""
