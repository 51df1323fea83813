"""Values that planner and checkers share: devices, plan, surface, requirements."""
