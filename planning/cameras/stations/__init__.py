"""Devices that stand together: heads, and what stands before a turntable."""
