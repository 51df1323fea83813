"""The simulated reconstruction: it shares data types with the planner, and no code."""
