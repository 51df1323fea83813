"""The audit behind `plan verify`: shares no code with the planner.

Of the toolkit it imports data types (plan, requirements, surface, device models), the
mesh and the bare ray caster, nothing that plans, samples, projects or sees.
"""
