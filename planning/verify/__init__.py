"""Checkers of plans; they share no code with the planner."""
