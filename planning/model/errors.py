"""What can go wrong while planning, as one tree.

Bad input is a ``ValueError``; an unmet requirement carries the best plan, so that
nothing already computed is lost. ``exit_code`` is what the command line returns.
"""


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


class TimeLimitError(PlanningError):
    """The time limit came before any plan."""

    exit_code = 5
