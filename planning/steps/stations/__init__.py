"""Plans of devices that stand together, or before a turntable."""
