"""Points on rings: the curves they lie on, and how surely."""
