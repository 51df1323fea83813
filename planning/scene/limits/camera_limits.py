"""When a camera sees a sample."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths
from geometry.devices import PinholeModel
from geometry.poses import inverse, transform
from planning.model.devices.planned import PlannedCamera
from planning.model.requirements import CameraLimits
from planning.scene.samples import SampleArrays, Target

from .limit import (
    BY_OBSTACLE,
    Array,
    InBetween,
    InRange,
    Limit,
    LimitRelaxation,
    Mask,
    RigFacts,
    causes,
    coarser,
    off_axis,
    range_ends,
    to_step,
    to_three_digits,
    wider_angle,
)

# Products of a few cosines and lengths are exact to this.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class CameraRays:
    """How a camera stands to n samples, in its frame at `local` [m], shape (n, 3).

    Unit viewing rays r in the world, distances t [m], and -N.r.
    """

    device: PinholeModel
    local: Array
    rays: Array
    distances: Array
    facing: Array

    @classmethod
    def of(cls, camera: PlannedCamera, target: Target) -> "CameraRays":
        """Return how a camera stands to samples."""
        points, normals = target.samples.points, target.samples.normals
        pose = camera.world_from_device
        offsets = points - pose[:3, 3]
        distances = lengths(offsets)
        rays = offsets / np.where(distances > 0, distances, 1.0)[:, None]
        facing = -np.einsum("ij,ij->i", normals, rays)
        local = transform(inverse(pose), points)
        return cls(camera.device, local, rays, distances, facing)

    @property
    def sample_distance(self) -> Array:
        """Z / (f cos(incidence)), what a pixel covers of the surface [m], (n,)."""
        depth, focal = self.local[:, 2], self.device.focal_px
        return depth / (focal * np.maximum(self.facing, 1e-9))


@dataclass(frozen=True, eq=False)
class ViewedSamples(SampleArrays):
    """One camera's view of n samples.

    Attributes:
        first_violated: Index in `SEEN_CAUSES` of the first limit that fails, `SEEN` if
            none, shape (n,).
        rays: Unit viewing rays r, shape (n, 3).
        distances: t in [m], shape (n,).
        facing: -N.r, shape (n,).
        jacobian: J_r in the world in [1/px], shape (n, 3, 2); 0 where a limit fails.
        off_centre: Pixels from the principal point, shape (n, 2); 0 likewise.
        station: Where the camera stands.
    """

    first_violated: NDArray[np.int8]
    rays: Array
    distances: Array
    facing: Array
    jacobian: Array
    off_centre: Array
    station: str = ""

    @property
    def seen(self) -> Mask:
        """Whether no limit fails, shape (n,)."""
        return self.first_violated == SEEN


@dataclass(frozen=True, eq=False)
class CellView:
    """The best a camera anywhere in a cell of poses may have of k samples.

    -N.r at most, shape (k,), and z at least, wherever in the image they appear [m].
    """

    facing: Array
    least_depth: Array
    focal_px: float


class CameraField(Limit[CameraRays, CellView, CameraLimits]):
    """Within the image."""

    name = "camera_field"
    words = "outside the image of every camera"

    def holds(self, view: CameraRays, rules: CameraLimits) -> Mask:
        """Return which samples appear in the image."""
        return view.device.in_field(view.local)

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield an image that reaches farther, up to three times as wide."""
        yield LimitRelaxation(
            self.name,
            lambda view: off_axis(view.device, view.local),
            to_step(1.0),
            lambda value: (
                f"a camera image that reaches {value:.0f} degrees off its middle "
                f"on every side"
            ),
        )


class CameraRange(InRange):
    """Within the depth of field."""

    name = "camera_range"
    words = "out of the cameras' depth of field"

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield the blur that is let pass where it sets the range; else its ends."""
        if facts.several_models:
            return
        sharp, focus = facts.device.range_m, facts.focus
        if focus is None:
            yield from range_ends(self.name, "camera", sharp, sharp)
            return
        allowed = focus.allowed_m

        def ask(view: CameraRays) -> Array:
            away = view.distances
            inside = (away >= allowed[0]) & (away <= allowed[1])
            return np.where(inside, focus.circle_px(away), np.inf)

        def say(value: float) -> str:
            stopped = focus.f_number * value / focus.blur_px
            return (
                f"camera.focus.blur_px = {value:.3g} (now {focus.blur_px:g}) or "
                f"camera.focus.f_number = {to_three_digits(np.array(stopped)):.3g} "
                f"(now {focus.f_number:g})"
            )

        yield LimitRelaxation(self.name, ask, to_three_digits, say)
        # Ends that the focus sets move only with it.
        yield from range_ends(self.name, "camera", allowed, sharp)


class CameraIncidence(Limit[CameraRays, CellView, CameraLimits]):
    """-N.r >= cos(max_incidence)."""

    name = "camera_incidence"
    words = "seen at too large an angle"

    def holds(self, view: CameraRays, rules: CameraLimits) -> Mask:
        """Return which samples face the camera."""
        return view.facing >= np.cos(rules.max_incidence)

    def may_hold(self, cell: CellView, rules: CameraLimits) -> Mask:
        """Return which may face a camera in the cell."""
        return cell.facing >= np.cos(rules.max_incidence) - ROUNDING

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield a larger angle."""
        limit = facts.required.camera.max_incidence
        yield wider_angle(self.name, limit, lambda view: view.facing)


class SampleDistance(Limit[CameraRays, CellView, CameraLimits]):
    """z / (f cos(incidence)) <= max_sample_distance."""

    name = "sample_distance"
    words = "sampled too coarsely"

    def holds(self, view: CameraRays, rules: CameraLimits) -> Mask | None:
        """Return where a pixel covers little enough of the surface."""
        limit = rules.max_sample_distance_m
        return None if limit is None else view.sample_distance <= limit

    def may_hold(self, cell: CellView, rules: CameraLimits) -> Mask | None:
        """Return where it may, from the least depth."""
        limit = rules.max_sample_distance_m
        if limit is None:
            return None
        widest = limit * cell.focal_px * np.maximum(cell.facing, 1e-9)
        return cell.least_depth * (1.0 - ROUNDING) <= widest

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield a larger distance."""
        limit = facts.required.camera.max_sample_distance_m
        yield from coarser(self.name, limit, lambda view: view.sample_distance)


CAMERA_LIMITS: tuple[Limit[Any, Any, Any], ...] = (
    CameraField(),
    CameraRange(),
    CameraIncidence(),
    InBetween("camera_occlusion", "hidden from every camera that faces it"),
    InBetween("camera_body", "hidden by a device's body"),
    InBetween(BY_OBSTACLE, "behind an obstacle"),
    SampleDistance(),
)
SEEN_CAUSES = causes(CAMERA_LIMITS)
SEEN = len(SEEN_CAUSES)
OCCLUDED = SEEN_CAUSES.index("camera_occlusion")
BLOCKED = SEEN_CAUSES.index("camera_body")
OBSTRUCTED = SEEN_CAUSES.index(BY_OBSTACLE)
