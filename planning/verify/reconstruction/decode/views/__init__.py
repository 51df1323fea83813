"""Pairs of cameras that see the same texture: where their images match."""
