"""What one device more or fewer would change."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.coverage_records import CameraMarginal, ProjectorMarginal
from planning.scene.draws import DRAWS
from planning.scene.lighting import lit_stages
from planning.scene.limits.projector_limits import LIT
from planning.scene.measuring.measured import lit_samples, measured_by
from planning.scene.samples import Target
from planning.scene.scene import Scene

from .claims import Claims
from .judged import Devices

_D = TypeVar("_D", PlannedProjector, PlannedCamera)
_Mask = NDArray[np.bool_]
_Areas = tuple[float, float]


@dataclass(frozen=True, eq=False)
class OfNumber(Generic[_D]):
    """Devices that a row of `marginal` speaks of, as they are written.

    Attributes:
        reference: Their places among the reference poses; None: they are the plan's, or
            stand elsewhere, and the file doesn't say where.
    """

    devices: Sequence[_D]
    reference: tuple[int, ...] | None = None

    @property
    def key(self) -> dict[str, tuple[int, ...]]:
        """Their places as a row has them; no key where there are none."""
        return {} if self.reference is None else {"reference": self.reference}


def of_numbers(
    by_count: Mapping[int, Sequence[_D]],
    planned: Sequence[_D],
    reference: tuple[Sequence[_D], Sequence[_D]],
    rounded: Callable[[_D, str], _D],
) -> dict[int, OfNumber[_D]]:
    """Return the devices of each number as they are written; the plan's of its own.

    `reference` are the poses that were candidates, and the same as written.
    """
    place = {id(device): k for k, device in enumerate(reference[0])}
    numbers: dict[int, OfNumber[_D]] = {}
    for n, devices in sorted(by_count.items()):
        places = tuple(place.get(id(device), -1) for device in devices)
        if n == len(planned):
            numbers[n] = OfNumber(planned)
        elif min(places) >= 0:
            numbers[n] = OfNumber([reference[1][k] for k in places], places)
        else:
            numbers[n] = OfNumber([rounded(device, "") for device in devices])
    return numbers


def marginal_records(
    scene: Scene,
    devices: Devices,
    claims: Claims,
    numbers: tuple[
        Mapping[int, OfNumber[PlannedProjector]], Mapping[int, OfNumber[PlannedCamera]]
    ],
    evenly: Sequence[PlannedProjector],
) -> tuple[ProjectorMarginal | CameraMarginal, ...]:
    """Return the plan's `marginal`: areas with 1, 2, ... devices of either kind.

    Other cameras measure with the projectors `evenly` ringed: fine rings belong to the
    planned cameras.
    """
    target, surface = claims.coverage.target, claims.coverage.surface

    def lit(lights: Sequence[PlannedProjector], samples: Target) -> _Mask:
        stages = lit_stages(scene.among(lights), lights, samples)
        return np.any(stages == LIT, axis=1)

    def measured(cameras: Sequence[PlannedCamera], samples: Target) -> _Mask:
        among = scene.among((*evenly, *cameras))
        light = lit_samples(among, evenly, samples)
        return np.any(measured_by(among, cameras, light), axis=1)

    def worst_region(n: int) -> tuple[int, float] | None:
        samples = claims.region_samples
        if n == len(devices.projectors):
            return samples.worst(samples.lit)
        return samples.worst(lit(numbers[0][n].devices, samples.target))

    lights = _areas(
        scene,
        numbers[0],
        {len(devices.projectors): (target.lit_m2, surface.lit_m2)},
        lit,
    )
    views = _areas(
        scene,
        numbers[1],
        {len(devices.cameras): (target.measured_m2, surface.measured_m2)},
        measured,
    )
    return (
        *(
            ProjectorMarginal(
                n_projectors=n,
                lit_target_m2=a,
                lit_surface_m2=b,
                worst_region=worst[0],
                worst_region_lit=worst[1],
                **numbers[0][n].key,
            )
            for n, (a, b) in lights.items()
            for worst in (worst_region(n) or (None, None),)
        ),
        *(
            CameraMarginal(
                n_cameras=n,
                measured_target_m2=a,
                measured_surface_m2=b,
                **numbers[1][n].key,
            )
            for n, (a, b) in views.items()
        ),
    )


def _areas(
    scene: Scene,
    numbers: Mapping[int, OfNumber[_D]],
    claimed: Mapping[int, _Areas],
    covered: Callable[[Sequence[_D], Target], _Mask],
) -> dict[int, _Areas]:
    """Covered areas of target and surface by the number of devices, [m²]."""
    sets = scene.target_samples(DRAWS.claims), scene.surface_samples(DRAWS.claims)
    areas: dict[int, _Areas] = {}
    for n, of_number in sorted(numbers.items()):
        a, b = claimed.get(n) or (
            float(s.samples.weight * covered(of_number.devices, s).sum()) for s in sets
        )
        if n > max(claimed):
            # A device added to the planned ones can't cover less than they do.
            a, b = max(a, areas[n - 1][0]), max(b, areas[n - 1][1])
        areas[n] = (a, b)
    return areas
