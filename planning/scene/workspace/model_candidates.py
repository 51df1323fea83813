"""Candidate viewpoints of every model of a kind of device."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera, PlannedProjector

from .candidates import Candidates

_D = TypeVar("_D", PlannedProjector, PlannedCamera)


def one_of_each(devices: Iterable[_D]) -> tuple[_D, ...]:
    """Return the first device of each model, as templates that stand nowhere.

    One that stands already may have a body, or rings, of its own: others come first.
    """
    models: dict[str, _D] = {}
    for device in sorted(devices, key=lambda one: bool(one.existing)):
        models.setdefault(device.model, replace(device, existing=""))
    return tuple(models.values())


@dataclass(frozen=True, eq=False)
class ModelCandidates(Generic[_D]):
    """Gives candidates of each of several models, as `Candidates` gives those of one.

    Attributes:
        of_models: What gives those of one model each.
    """

    of_models: tuple[Candidates[_D], ...]

    def over(self, n: int) -> tuple[_D, ...]:
        """Return at least n candidates over the workspace, as many of each model.

        Raises:
            InfeasibleLimitsError: As of `Candidates`.
        """
        each = -(-n // len(self.of_models))
        return self._joined(lambda one: one.over(each))

    def towards(self, directions: NDArray[np.float64]) -> tuple[_D, ...]:
        """Return admissible ones in directions from the centre, unit, shape (n, 3)."""
        return self._joined(lambda one: one.towards(directions))

    def nearest(self, n: int) -> tuple[_D, ...]:
        """Return about n candidates, as many of each model, as near as they may be."""
        each = -(-n // len(self.of_models))
        return self._joined(lambda one: one.nearest(each))

    def around(
        self,
        chosen: Sequence[_D],
        n_lattice: int,
        scale: float = 1.0,
        *,
        far: bool = False,
    ) -> tuple[_D, ...]:
        """Return candidates around chosen ones, each of the model of its own.

        `n_lattice` counts all models' candidates; the rest is as of `Candidates`.
        """
        each = n_lattice // len(self.of_models)

        def around(one: Candidates[_D]) -> tuple[_D, ...]:
            own = [c for c in chosen if c.model == one.template.model]
            return one.around(own, each, scale, far=far)

        return self._joined(around)

    def _joined(
        self, offer: Callable[[Candidates[_D]], tuple[_D, ...]]
    ) -> tuple[_D, ...]:
        return tuple(device for one in self.of_models for device in offer(one))
