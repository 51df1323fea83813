"""The audit behind `plan verify`: shares no code with the planner.

Of the toolkit it imports data types (plan, requirements, surface, device models), the
mesh and the bare ray caster, nothing that plans, samples, projects or sees.
"""

from .audit import Audit, audit_plan
from .samples import AuditSamples

__all__ = ["Audit", "AuditSamples", "audit_plan"]
