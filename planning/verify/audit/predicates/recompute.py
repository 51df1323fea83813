"""What the plan's poses light and measure, and what any reference pose could."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.devices import PinholeModel
from planning.model.plan import RigPlan
from planning.model.requirements import ProjectorLimits, Requirements
from planning.verify.audit.audit_samples import AuditSamples

from .blocks import blocks_before, blocks_beside
from .occlusion import Shadow
from .predicates import (
    LIT,
    MEASURED,
    SEEN,
    AuditCamera,
    AuditProjector,
    light_margin,
    light_steps,
    pair_steps,
    sight_steps,
)

_NOT_LIT = -1


@dataclass(frozen=True, eq=False)
class Recomputed:
    """The plan's own poses against one set of samples.

    Attributes:
        samples: The samples.
        light: Limits of *lit* passed, for each projector, shape (n_p, n).
        margins: Margin of each lit sample, -inf where unlit, shape (n_p, n) [rad].
        pairs: Limits of *seen* and *measurable* passed, in that order, -1 where the
            projector doesn't light the sample, shape (n_p, n_c, n).
    """

    samples: AuditSamples
    light: NDArray[np.int8]
    margins: NDArray[np.float64]
    pairs: NDArray[np.int8]

    @cached_property
    def lit_by(self) -> NDArray[np.bool_]:
        """Whether each projector lights each sample, shape (n_p, n)."""
        return self.light == LIT

    @cached_property
    def lit(self) -> NDArray[np.bool_]:
        """Whether any projector lights each sample, shape (n,)."""
        return np.any(self.lit_by, axis=0)

    @cached_property
    def measured_by(self) -> NDArray[np.bool_]:
        """Whether each camera measures each sample with any projector, (n_c, n)."""
        return np.any(self.pairs == MEASURED, axis=0)

    @cached_property
    def measured(self) -> NDArray[np.bool_]:
        """Whether any pair of the plan measures each sample, shape (n,)."""
        return np.any(self.measured_by, axis=0)

    @cached_property
    def server(self) -> NDArray[np.int64]:
        """Index of the projector that serves each sample, -1 where unlit, (n,)."""
        if len(self.margins) == 0:
            return np.full(len(self.samples), -1)
        return np.where(self.lit, np.argmax(self.margins, axis=0), -1)

    @cached_property
    def cause(self) -> NDArray[np.int64]:
        """Index into `LIGHT_CAUSES + SIGHT_CAUSES + PAIR_CAUSES`, -1 where measured.

        That of the projector (unlit samples) or lit pair (lit ones) that came furthest.
        """
        n = len(self.samples)
        light = self.light.max(axis=0, initial=0)
        pair = self.pairs.reshape(-1, n).max(axis=0, initial=0)
        furthest = np.where(self.lit, LIT + pair, light)
        return np.where(self.measured, -1, furthest)


@dataclass(frozen=True, eq=False)
class Reach:
    """What the reference poses could do.

    Attributes:
        projectors: Reachable by projectors, shape (n,).
        cameras: Reachable by cameras, shape (n,).
        furthest: Most limits of *lit* that any reference projector passes, shape (n,);
            final only where no reference projector lights the sample.
        furthest_pair: Most limits of *seen* and *measurable* that any pair of a
            reference camera and a projector passes, shape (n,); final only on lit
            samples that no such pair, and none of the plan's, measures.
    """

    projectors: NDArray[np.bool_]
    cameras: NDArray[np.bool_]
    furthest: NDArray[np.int8]
    furthest_pair: NDArray[np.int8]


def audit_projectors(plan: RigPlan) -> tuple[AuditProjector, ...]:
    """Return the plan's projectors."""
    return tuple(
        AuditProjector(
            p.device,
            p.world_from_device,
            p.world_from_ring,
            p.ring_radii,
            blocks_beside(plan, p),
        )
        for p in plan.projectors
    )


def audit_cameras(plan: RigPlan) -> tuple[AuditCamera, ...]:
    """Return the plan's cameras."""
    return tuple(
        AuditCamera(c.device, c.world_from_device, blocks_beside(plan, c))
        for c in plan.cameras
    )


def light_only(
    plan: RigPlan,
    samples: AuditSamples,
    shadow: Shadow,
    limits: ProjectorLimits | None = None,
) -> tuple[NDArray[np.int8], NDArray[np.float64]]:
    """Return `light` and `margins` of `Recomputed`; by the plan's limits or others."""
    limits = plan.requirements.projector if limits is None else limits
    lamps = audit_projectors(plan)
    light = np.zeros((len(lamps), len(samples)), dtype=np.int8)
    margins = np.full(light.shape, -np.inf)
    for row, lamp in enumerate(lamps):
        light[row] = light_steps(lamp, samples, limits, shadow)
        lit = light[row] == LIT
        margins[row, lit] = light_margin(lamp, samples.take(lit), limits)
    return light, margins


def recompute(
    plan: RigPlan,
    samples: AuditSamples,
    shadow: Shadow,
    requirements: Requirements | None = None,
) -> Recomputed:
    """Recompute what every device and every pair of the plan does to each sample.

    Args:
        plan: Devices, and the limits that hold by default.
        samples: Of its surface.
        shadow: Occlusion.
        requirements: Limits other than the plan's.
    """
    limits = plan.requirements if requirements is None else requirements
    light, margins = light_only(plan, samples, shadow, limits.projector)
    lamps, eyes = audit_projectors(plan), audit_cameras(plan)
    lit = np.any(light == LIT, axis=0)
    pairs = np.full((len(lamps), len(eyes), len(samples)), _NOT_LIT, dtype=np.int8)
    for column, eye in enumerate(eyes):
        sight = sight_steps(eye, samples.take(lit), limits.camera, shadow)
        whole = np.zeros(len(samples), dtype=np.int8)
        whole[lit] = sight
        for row, lamp in enumerate(lamps):
            by_lamp = light[row] == LIT
            both = np.flatnonzero(by_lamp & (whole == SEEN))
            pairs[row, column, by_lamp] = whole[by_lamp]
            pairs[row, column, both] += pair_steps(
                lamp, eye, samples.take(both), limits.triangulation
            )
    return Recomputed(samples, light, margins, pairs)


def reach_of(plan: RigPlan, own: Recomputed, shadow: Shadow, seed: int) -> Reach:
    """Recompute what the reference poses reach, and add what the plan itself does.

    Poses are taken in a random order, each on the samples that no earlier one reached;
    the result doesn't depend on the order, only the time does.
    """
    rng = np.random.default_rng(seed)
    by_projectors, furthest = _reach_by_projectors(plan, own, shadow, rng)
    by_cameras, furthest_pair = _reach_by_cameras(plan, own, shadow, rng)
    return Reach(by_projectors, by_cameras, furthest, furthest_pair)


def reference_lamps(plan: RigPlan) -> list[AuditProjector]:
    """Return the reference projectors: the plan's own model at every reference pose."""
    surface = plan.surface
    if not plan.projectors:
        return []
    device = plan.projectors[0].device
    last = np.array([plan.requirements.workspace.reference_ring_radius])
    return [
        AuditProjector(device, pose, ring, last, blocks_before(plan, "projector", pose))
        for pose, ring in zip(
            surface.reference_projectors, surface.reference_rings, strict=True
        )
    ]


def _reach_by_projectors(
    plan: RigPlan, own: Recomputed, shadow: Shadow, rng: np.random.Generator
) -> tuple[NDArray[np.bool_], NDArray[np.int8]]:
    limits = plan.requirements.projector
    lamps = reference_lamps(plan)
    furthest = np.zeros(len(own.samples), dtype=np.int8)
    left = np.flatnonzero(~own.lit)
    rest = own.samples.take(left)
    for index in rng.permutation(len(lamps)):
        steps = light_steps(lamps[index], rest, limits, shadow)
        furthest[left] = np.maximum(furthest[left], steps)
        dark = steps < LIT
        if not np.all(dark):
            left, rest = left[dark], rest.take(dark)
    return own.lit | (furthest == LIT), furthest


def _reach_by_cameras(
    plan: RigPlan, own: Recomputed, shadow: Shadow, rng: np.random.Generator
) -> tuple[NDArray[np.bool_], NDArray[np.int8]]:
    furthest = np.zeros(len(own.samples), dtype=np.int8)
    furthest[own.measured] = MEASURED
    if not plan.cameras:
        return own.measured.copy(), furthest
    device: PinholeModel = plan.cameras[0].device
    lamps = audit_projectors(plan)
    left = np.flatnonzero(own.lit & ~own.measured)
    rest = own.samples.take(left)
    poses = plan.surface.reference_cameras
    for index in rng.permutation(len(poses)):
        if len(left) == 0:
            break
        steps = _steps_with_any(
            AuditCamera(
                device, poses[index], blocks_before(plan, "camera", poses[index])
            ),
            lamps,
            rest,
            own.lit_by[:, left],
            plan.requirements,
            shadow,
        )
        furthest[left] = np.maximum(furthest[left], steps)
        found = steps == MEASURED
        if np.any(found):
            left, rest = left[~found], rest.take(~found)
    return furthest == MEASURED, furthest


def _steps_with_any(
    eye: AuditCamera,
    lamps: tuple[AuditProjector, ...],
    samples: AuditSamples,
    lit_by: NDArray[np.bool_],
    requirements: Requirements,
    shadow: Shadow,
) -> NDArray[np.int8]:
    """How many limits each sample passes with the best projector that lights it."""
    steps = sight_steps(eye, samples, requirements.camera, shadow)
    seen = steps == SEEN
    for lamp, lit in zip(lamps, lit_by, strict=True):
        both = np.flatnonzero(seen & lit & (steps < MEASURED))
        if len(both):
            own = pair_steps(lamp, eye, samples.take(both), requirements.triangulation)
            steps[both] = np.maximum(steps[both], SEEN + own)
    return steps
