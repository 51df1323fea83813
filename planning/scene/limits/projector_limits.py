"""Eq. (2) with margins: when a projector lights a sample."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from geometry.devices import ParallelModel
from planning.model.planned import PlannedProjector
from planning.model.requirements import ProjectorLimits
from planning.scene.lights import light_of
from planning.scene.patterns.pattern import pattern_of
from planning.scene.samples import SampleColumns

from .limit import (
    STEEPEST,
    Array,
    InBetween,
    Limit,
    LimitRelaxation,
    Mask,
    RigFacts,
    causes,
    degrees,
    range_ends,
    to_step,
    widened,
)


@dataclass(frozen=True, eq=False)
class ProjectorView:
    """How a projector's light meets n samples.

    Attributes:
        projector: Pose, optics and pattern.
        points: In the world [m], columns, shape (3, n).
        local: In the device's frame [m], likewise.
        distances: |P - Q| (diverging) or z (parallel) in [m], shape (n,).
        incidence_cos: -N.L, shape (n,).
        tangent_cos: |T1.L|, 0 where T1 is arbitrary, shape (n,).
    """

    projector: PlannedProjector
    points: Array
    local: Array
    distances: Array
    incidence_cos: Array
    tangent_cos: Array

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


class ProjectorLimit(Limit[ProjectorView, object, ProjectorLimits]):
    """A limit of projectors."""


class ProjectorBeam(ProjectorLimit):
    """Within the pattern, and in the light that leaves the device."""

    name = "projector_beam"
    words = "outside the beam or the image of every projector"

    def holds(self, view: ProjectorView, rules: ProjectorLimits) -> Mask:
        """Return which samples the pattern reaches."""
        inside = pattern_of(view.projector).inside(view.points)
        return inside & view.projector.device.in_field(view.local.T)

    def relaxations(self, facts: RigFacts) -> tuple[LimitRelaxation, ...]:
        """Return an image or beam that reaches farther, up to three times as wide."""
        parallel = isinstance(facts.device, ParallelModel)
        return (
            LimitRelaxation(
                self.name,
                _off_axis,
                to_step(1.0),
                lambda value: (
                    f"a beam of {value:.0f} mm about its axis"
                    if parallel
                    else f"an image that reaches {value:.0f} degrees off its middle on "
                    f"every side"
                ),
            ),
        )


class ProjectorRange(ProjectorLimit):
    """Within the depth of field."""

    name = "projector_range"
    words = "out of the projectors' range"

    def holds(self, view: ProjectorView, rules: ProjectorLimits) -> Mask:
        """Return which samples are sharp."""
        low, high = view.projector.device.range_m
        return (view.distances >= low) & (view.distances <= high)

    def relaxations(self, facts: RigFacts) -> tuple[LimitRelaxation, ...]:
        """Return either end of the range."""
        sharp = facts.device.range_m
        return range_ends(self.name, "projector", sharp, sharp)[:2]


class ProjectorIncidence(ProjectorLimit):
    """-N.L >= cos(theta_max)."""

    name = "projector_incidence"
    words = "met by the light at too large an angle"

    def holds(self, view: ProjectorView, rules: ProjectorLimits) -> Mask:
        """Return which samples face the light."""
        return view.incidence_cos >= np.cos(rules.max_incidence)

    def relaxations(self, facts: RigFacts) -> tuple[LimitRelaxation, ...]:
        """Return a larger angle."""
        limit = facts.required.projector.max_incidence
        least = np.cos(max(limit, STEEPEST))
        return (
            LimitRelaxation(
                self.name,
                lambda view: np.where(
                    view.incidence_cos >= least, degrees(view.incidence_cos), np.inf
                ),
                to_step(1.0),
                lambda value: (
                    f"limits.projector_max_incidence_deg = {value:.0f} "
                    f"(now {np.degrees(limit):g})"
                ),
            ),
        )


class TangentAngle(ProjectorLimit):
    """|T1.L| <= cos(tau_min)."""

    name = "tangent_angle"
    words = "lit along the steep direction (tangent angle too small)"

    def holds(self, view: ProjectorView, rules: ProjectorLimits) -> Mask:
        """Return which samples aren't lit along T1."""
        return view.tangent_cos <= np.cos(rules.min_tangent_angle)

    def relaxations(self, facts: RigFacts) -> tuple[LimitRelaxation, ...]:
        """Return a smaller angle."""
        limit = facts.required.projector.min_tangent_angle
        return (
            LimitRelaxation(
                self.name,
                lambda view: -degrees(view.tangent_cos),
                to_step(1.0),
                lambda value: (
                    f"limits.min_tangent_angle_deg = {-value:.0f} "
                    f"(now {np.degrees(limit):g})"
                ),
            ),
        )


class ProjectorOcclusion(InBetween):
    """Not in the shadow of the surface."""

    name = "projector_occlusion"
    words = "shadowed from every projector that faces it"


class ProjectorBody(InBetween):
    """No body of another device in between."""

    name = "projector_body"
    words = "kept from the light by a device's body"


PROJECTOR_LIMITS: tuple[Limit[Any, Any, Any], ...] = (
    ProjectorBeam(),
    ProjectorRange(),
    ProjectorIncidence(),
    TangentAngle(),
    ProjectorOcclusion(),
    ProjectorBody(),
)
CAUSES = causes(PROJECTOR_LIMITS)
LIT = len(CAUSES)
OCCLUDED = CAUSES.index("projector_occlusion")
BLOCKED = CAUSES.index("projector_body")
INCIDENCE = CAUSES.index("projector_incidence")


def _off_axis(view: ProjectorView) -> Array:
    """How far samples are off the middle, inf beyond the widest field, (n,)."""
    wide = widened(view.projector.device)
    local = view.local.T
    return np.where(wide.in_field(local), light_of(wide).off_axis(local), np.inf)
