"""What can go wrong while planning, as one tree.

Bad input is a ``ValueError``; an unmet requirement carries the best plan, so that
nothing already computed is lost. ``exit_code`` is what the command line returns.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .plan import RigPlan


class PlanningError(Exception):
    """Base of every error raised on purpose by ``planning``."""

    exit_code = 3


class InputError(PlanningError, ValueError):
    """A mesh, rig, plan or argument that can't be used."""


class RigError(InputError):
    """A rig file or preset that can't be used."""


class PlanFileError(InputError):
    """A plan file, or the surface beside it, that can't be used."""


class CapturesError(InputError):
    """Captured images that can't be used."""


class CalibrationError(InputError):
    """A calibration file that can't be used."""


class InfeasibleLimitsError(PlanningError):
    """No device can serve anything: empty or contradictory limits."""

    exit_code = 4


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


class TimeLimitError(PlanningError):
    """The time limit came before any plan."""

    exit_code = 5


class InterruptedPlanError(PlanningError):
    """The run was interrupted after a first plan stood.

    Attributes:
        plan: The best plan so far, marked `truncated`.
    """

    exit_code = 130

    def __init__(self, plan: RigPlan) -> None:
        super().__init__("interrupted; the best plan so far is kept")
        self.plan = plan
