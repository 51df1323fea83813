"""A rig as a scene for Mitsuba 3, and what Mitsuba renders of it."""
