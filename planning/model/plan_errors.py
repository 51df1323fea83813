"""Errors that carry the best plan, so that nothing computed is lost."""

from .errors import PlanningError
from .plan import RigPlan


class RequirementError(PlanningError):
    """A plan was made, but it misses a requirement.

    Attributes:
        plan: The best plan found.
        shortfalls: One sentence for each missed requirement, with its cause.
    """

    exit_code = 1

    def __init__(self, plan: RigPlan, shortfalls: tuple[str, ...]) -> None:
        super().__init__("; ".join(shortfalls))
        self.plan = plan
        self.shortfalls = shortfalls


class InterruptedPlanError(PlanningError):
    """The run was interrupted after a first plan stood.

    Attributes:
        plan: The best plan so far, marked `truncated`.
    """

    exit_code = 130

    def __init__(self, plan: RigPlan) -> None:
        super().__init__("interrupted; the best plan so far is kept")
        self.plan = plan
