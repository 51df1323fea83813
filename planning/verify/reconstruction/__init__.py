"""The check from pixels: it shares no code with the planner but data types."""
