"""Eq. (2) with margins: when a projector lights a sample."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np

from geometry.devices import DeviceModel
from planning.model.devices.planned import PlannedProjector
from planning.model.requirements import ProjectorLimits
from planning.scene.codes.patterns import pattern_of
from planning.scene.lights import light_of
from planning.scene.samples import SampleColumns

from .camera_limits import ROUNDING
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
    degrees,
    off_axis,
    range_ends,
    to_step,
    wider_angle,
)


@dataclass(frozen=True, eq=False)
class ProjectorView:
    """How a projector's light meets n samples.

    Points are columns of the world and of the device's frame [m], shape (3, n);
    distances are |P - Q| (diverging) or z (parallel) [m], the cosines -N.L and |T1.L|.
    """

    projector: PlannedProjector
    points: Array
    local: Array
    distances: Array
    incidence_cos: Array
    tangent_cos: Array

    @property
    def device(self) -> DeviceModel:
        """The projector's optics."""
        return self.projector.device

    @classmethod
    def of(cls, projector: PlannedProjector, samples: SampleColumns) -> "ProjectorView":
        """Return the view of samples; only what limits depend on is computed."""
        pose = projector.world_from_device
        offsets = samples.points - pose[:3, 3:]
        light = light_of(projector.device)
        return cls(
            projector,
            samples.points,
            pose[:3, :3].T @ offsets,
            *light.cosines(pose, offsets, samples.normals, samples.steep),
        )


@dataclass(frozen=True, eq=False)
class LightCell:
    """The best that light from anywhere in a cell of poses may have of k samples.

    -N.L at most, and |T1.L| at least, shape (k,).
    """

    incidence_cos: Array
    tangent_cos: Array


class ProjectorBeam(Limit[ProjectorView, object, ProjectorLimits]):
    """Within the pattern, and in the light that leaves the device."""

    name = "projector_beam"
    words = "outside the beam or the image of every projector"

    def holds(self, view: ProjectorView, rules: ProjectorLimits) -> Mask:
        """Return which samples the pattern reaches."""
        inside = pattern_of(view.projector).inside(view.points)
        return inside & view.device.in_field(view.local.T)

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield an image or beam that reaches farther, up to three times as wide."""
        image = light_of(facts.device).reach_words
        yield LimitRelaxation(
            self.name,
            lambda view: off_axis(view.device, view.local.T),
            to_step(1.0),
            lambda value: image.format(value),
        )


class ProjectorRange(InRange):
    """Within the depth of field."""

    name = "projector_range"
    words = "out of the projectors' range"

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield either end of the range."""
        if facts.several_models:
            return
        sharp = facts.device.range_m
        yield from islice(range_ends(self.name, "projector", sharp, sharp), 2)


class ProjectorIncidence(Limit[ProjectorView, LightCell, ProjectorLimits]):
    """-N.L >= cos(theta_max)."""

    name = "projector_incidence"
    words = "met by the light at too large an angle"

    def holds(self, view: ProjectorView, rules: ProjectorLimits) -> Mask:
        """Return which samples face the light."""
        return view.incidence_cos >= np.cos(rules.max_incidence)

    def may_hold(self, cell: LightCell, rules: ProjectorLimits) -> Mask:
        """Return which samples may face light from the cell."""
        return cell.incidence_cos >= np.cos(rules.max_incidence) - ROUNDING

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield a larger angle."""
        limit = facts.required.projector.max_incidence
        yield wider_angle(self.name, limit, lambda view: view.incidence_cos)


class TangentAngle(Limit[ProjectorView, LightCell, ProjectorLimits]):
    """|T1.L| <= cos(tau_min)."""

    name = "tangent_angle"
    words = "lit along the steep direction (tangent angle too small)"

    def holds(self, view: ProjectorView, rules: ProjectorLimits) -> Mask:
        """Return which samples aren't lit along T1."""
        return view.tangent_cos <= np.cos(rules.min_tangent_angle)

    def may_hold(self, cell: LightCell, rules: ProjectorLimits) -> Mask:
        """Return which samples not all light from the cell meets along T1."""
        return cell.tangent_cos <= np.cos(rules.min_tangent_angle) + ROUNDING

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield a smaller angle."""
        limit = facts.required.projector.min_tangent_angle
        yield LimitRelaxation(
            self.name,
            lambda view: -degrees(view.tangent_cos),
            to_step(1.0),
            lambda value: (
                f"limits.min_tangent_angle_deg = {-value:.0f} "
                f"(now {np.degrees(limit):g})"
            ),
        )


class PixelDistance(Limit[ProjectorView, object, ProjectorLimits]):
    """p(z) / (-N.L) <= max_sample_distance, of a dense code."""

    name = "pixel_distance"
    words = "lit by too coarse pixels"

    def holds(self, view: ProjectorView, rules: ProjectorLimits) -> Mask | None:
        """Return where a pixel of the panel covers little enough of the surface."""
        limit = rules.max_sample_distance_m
        return None if limit is None else _pixel_distance(view) <= limit

    def relaxations(self, facts: RigFacts) -> Iterator[LimitRelaxation]:
        """Yield a larger distance."""
        limit = facts.required.projector.max_sample_distance_m
        yield from coarser(self.name, limit, _pixel_distance)


def _pixel_distance(view: ProjectorView) -> Array:
    wide = view.device.pixel_m(view.local[2])
    return wide / np.maximum(view.incidence_cos, 1e-9)


PROJECTOR_LIMITS: tuple[Limit[Any, Any, Any], ...] = (
    ProjectorBeam(),
    ProjectorRange(),
    ProjectorIncidence(),
    TangentAngle(),
    PixelDistance(),
    InBetween("projector_occlusion", "shadowed from every projector that faces it"),
    InBetween("projector_body", "kept from the light by a device's body"),
    InBetween(BY_OBSTACLE, "behind an obstacle"),
)
CAUSES = causes(PROJECTOR_LIMITS)
LIT = len(CAUSES)
OCCLUDED = CAUSES.index("projector_occlusion")
BLOCKED = CAUSES.index("projector_body")
OBSTRUCTED = CAUSES.index(BY_OBSTACLE)
