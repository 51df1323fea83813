"""Turntables: devices before a part that turns, and the angles it is measured at."""
