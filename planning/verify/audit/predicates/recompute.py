"""What the plan's poses light and measure, and what any reference pose could."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

import numpy as np

from geometry.arrays import Array, Ints, Mask
from geometry.parallel import mapped
from geometry.rays.rays import equal_parts
from planning.model.plan import RigPlan
from planning.model.requirements import Requirements
from planning.verify.audit.audit_samples import AuditSamples

from .audit_devices import (
    AuditCamera,
    AuditProjector,
    audit_cameras,
    audit_projectors,
)
from .audit_optics import dot, towards
from .occlusion import Shadow
from .predicates import (
    LIGHT_CAUSES,
    LIT,
    MEASURED,
    SEEN,
    SIGHT_CAUSES,
    Steps,
    light_margin,
    light_steps,
    pair_steps,
    sight_steps,
)
from .reference_devices import reference_cameras, reference_projectors

_NOT_LIT = -1
_Device = TypeVar("_Device")
# Place of the limit of incidence among those of light, and of sight.
_INCIDENCE = LIGHT_CAUSES.index("projector_incidence")
assert _INCIDENCE == SIGHT_CAUSES.index("camera_incidence")
# Samples that go to a thread together, at most: with fewer, thousands of devices are as
# many calls of numpy that take longer than what they do.
_PART = 10_000


@dataclass(frozen=True, eq=False)
class Recomputed:
    """The plan's poses against one set of samples.

    Attributes:
        light: Limits of *lit* passed, for each projector, shape (n_p, n).
        margins: Margin of each lit sample, -inf where unlit, shape (n_p, n) [rad].
        pairs: Limits of *seen* and *measurable* passed, in that order, -1 where the
            projector doesn't light the sample, shape (n_p, n_c, n).
    """

    samples: AuditSamples
    light: Steps
    margins: Array
    pairs: Steps

    @cached_property
    def lit_by(self) -> Mask:
        """Whether each projector lights each sample, shape (n_p, n)."""
        return self.light == LIT

    @cached_property
    def lit(self) -> Mask:
        """Whether any projector lights each sample, shape (n,)."""
        return np.any(self.lit_by, axis=0)

    @cached_property
    def measured_by(self) -> Mask:
        """Whether each camera measures each sample with any projector, (n_c, n)."""
        return np.any(self.pairs == MEASURED, axis=0)

    def measured_with(self, cameras: list[int]) -> Mask:
        """Return what some of the cameras measure without the others, shape (n,)."""
        return np.any(self.measured_by[cameras], axis=0)

    @cached_property
    def alone(self) -> Mask:
        """Whether a sample isn't measured without each camera, shape (n_c, n)."""
        every = range(len(self.measured_by))
        rest = [self.measured_with([i for i in every if i != c]) for c in every]
        return self.measured & ~np.array(rest).reshape(len(every), -1)

    @property
    def steps_of_cameras(self) -> Steps:
        """Limits of *seen* and more that cameras pass on what is lit, (n_c, n)."""
        return self.pairs.max(axis=0, initial=-1)

    @cached_property
    def measured(self) -> Mask:
        """Whether any pair of the plan measures each sample, shape (n,)."""
        return np.any(self.measured_by, axis=0)

    @property
    def by_pair(self) -> Array:
        """Share of the samples that each pair measures, shape (n_p, n_c)."""
        return np.mean(self.pairs == MEASURED, axis=2)

    @cached_property
    def primary(self) -> Ints:
        """Index of each sample's primary projector, -1 where unlit, (n,)."""
        if len(self.margins) == 0:
            return np.full(len(self.samples), -1)
        return np.where(self.lit, np.argmax(self.margins, axis=0), -1)

    @cached_property
    def cause(self) -> Ints:
        """Index into `LIGHT_CAUSES + SIGHT_CAUSES + PAIR_CAUSES`, -1 where measured.

        That of the projector (unlit samples) or lit pair (lit ones) that came furthest.
        """
        n = len(self.samples)
        light = self.light.max(axis=0, initial=0)
        pair = self.pairs.reshape(-1, n).max(axis=0, initial=0)
        furthest = np.where(self.lit, LIT + pair, light)
        return np.where(self.measured, -1, furthest)


@dataclass(frozen=True, eq=False)
class Reachable:
    """What the reference poses could do.

    Attributes:
        projectors: Reachable by projectors, shape (n,); `cameras` likewise.
        furthest: Most limits of *lit* that any reference projector passes, shape (n,);
            final only where no reference projector lights the sample.
        furthest_pair: Most limits of *seen* and *measurable* that any pair of a
            reference camera and a projector passes, shape (n,); final only on lit
            samples that no such pair, and none of the plan's, measures.
    """

    projectors: Mask
    cameras: Mask
    furthest: Steps
    furthest_pair: Steps


def light_of_plan(
    plan: RigPlan, samples: AuditSamples, shadow: Shadow
) -> tuple[Steps, Array]:
    """Return `light` and `margins` of `Recomputed`."""
    limits = plan.requirements.projector
    projectors = audit_projectors(plan)
    light = np.zeros((len(projectors), len(samples)), dtype=np.int8)
    margins = np.full(light.shape, -np.inf)
    for p, projector in enumerate(projectors):
        light[p] = light_steps(projector, samples, limits, shadow)
        lit = light[p] == LIT
        margins[p, lit] = light_margin(projector, samples.take(lit), limits)
    return light, margins


def recompute(plan: RigPlan, samples: AuditSamples, shadow: Shadow) -> Recomputed:
    """Recompute what every device and every pair of the plan does to each sample."""
    limits = plan.requirements
    light, margins = light_of_plan(plan, samples, shadow)
    lit_by = light == LIT
    projectors, cameras = audit_projectors(plan), audit_cameras(plan)
    pairs = np.full((len(light), len(cameras), len(samples)), _NOT_LIT, dtype=np.int8)
    lit = np.flatnonzero(lit_by.any(axis=0))
    for c, camera in enumerate(cameras):
        pairs[:, c, lit] = pairs_with(
            camera, projectors, samples.take(lit), lit_by[:, lit], limits, shadow
        )
    return Recomputed(samples, light, margins, pairs)


def reachable_by(
    plan: RigPlan, actual: Recomputed, shadow: Shadow, seed: int
) -> Reachable:
    """Recompute what the reference poses cover, and add what the plan itself does.

    Poses are taken in a random order, each on the samples that no earlier one covered;
    the result doesn't depend on the order, only the time does.
    """
    rng = np.random.default_rng(seed)
    requirements, projectors = plan.requirements, audit_projectors(plan)

    def lights(projector: AuditProjector, chosen: Ints) -> Steps:
        samples = actual.samples.take(chosen)
        return light_steps(projector, samples, requirements.projector, shadow)

    def from_projector(projector: AuditProjector, points: Array) -> Array:
        return projector.light.to_points(points)[0]

    def from_camera(camera: AuditCamera, points: Array) -> Array:
        return towards(points, camera.world_from_device[:3, 3])[0]

    others = reference_projectors(plan)

    def measures(camera: AuditCamera, chosen: Ints) -> Steps:
        samples, lit_by = actual.samples.take(chosen), actual.lit_by[:, chosen]
        lights = projectors
        if camera.station:
            # One of a reference head: with the light of that head alone.
            lights = tuple(p for p in others if p.station == camera.station)
            limits = requirements.projector
            light = [light_steps(p, samples, limits, shadow) for p in lights]
            lit_by = np.stack(light) == LIT
        steps = pairs_with(camera, lights, samples, lit_by, requirements, shadow)
        return steps.max(axis=0, initial=0)

    beyond = actual.lit & ~actual.measured
    threads, samples = shadow.caster.threads, actual.samples
    squarely = _Squarely(samples, from_projector, requirements.projector.max_incidence)
    light = _furthest(others, lights, squarely, ~actual.lit, LIT, rng, threads)
    squarely = _Squarely(samples, from_camera, requirements.camera.max_incidence)
    cameras = reference_cameras(plan)
    pair = _furthest(cameras, measures, squarely, beyond, MEASURED, rng, threads)
    by_cameras = actual.measured | (pair == MEASURED)
    pair[actual.measured] = MEASURED
    return Reachable(actual.lit | (light == LIT), by_cameras, light, pair)


@dataclass(frozen=True, eq=False)
class _Squarely(Generic[_Device]):
    """Which samples a device meets at an angle that its limit of incidence allows.

    Attributes:
        way: Of a device and points (n, 3), the unit directions to these, (n, 3).
        most: The limit [rad].
    """

    samples: AuditSamples
    way: Callable[[_Device, Array], Array]
    most: float

    def met(self, device: _Device, chosen: Ints) -> Mask:
        """Return which of the chosen samples, shape (n,)."""
        along = self.way(device, self.samples.points[chosen])
        return -dot(self.samples.normals[chosen], along) >= np.cos(self.most)


def _furthest(
    devices: Sequence[_Device],
    steps_of: Callable[[_Device, Ints], Steps],
    squarely: _Squarely[_Device],
    wanted: Mask,
    every: int,
    rng: np.random.Generator,
    threads: int,
) -> Steps:
    """Most limits that any device passes on wanted samples, 0 on others, (n,)."""
    furthest = np.zeros(len(wanted), dtype=np.int8)
    order = rng.permutation(len(devices))

    def search(waiting: Ints) -> None:
        for index in order:
            if len(waiting) == 0:
                break
            # What isn't met squarely comes no further than to that limit.
            worth = furthest[waiting] < _INCIDENCE
            worth |= squarely.met(devices[index], waiting)
            looked = waiting[worth]
            if len(looked) == 0:
                continue
            steps = steps_of(devices[index], looked)
            furthest[looked] = np.maximum(furthest[looked], steps)
            waiting = waiting[furthest[waiting] < every]

    # Each sample is looked at by itself: no result depends on the parts.
    chosen = np.flatnonzero(wanted)
    parts = equal_parts(len(chosen), _PART, threads)
    mapped(search, [chosen[part] for part in parts], threads)
    return furthest


def pairs_with(
    camera: AuditCamera,
    projectors: Sequence[AuditProjector],
    samples: AuditSamples,
    lit_by: Mask,
    limits: Requirements,
    shadow: Shadow,
) -> Steps:
    """Return `Recomputed.pairs` of one camera, on samples lit as `lit_by` says.

    Projectors that it doesn't measure with are taken to light nothing.
    """
    sight = sight_steps(camera, samples, limits.camera, shadow)
    with_it = np.array([camera.works_with(projector) for projector in projectors])
    lit_by = lit_by & with_it[:, None]
    pairs = np.where(lit_by, sight, np.int8(_NOT_LIT))
    for p, projector in enumerate(projectors):
        both = np.flatnonzero(lit_by[p] & (sight == SEEN))
        pairs[p, both] += pair_steps(
            projector, camera, samples.take(both), limits.triangulation
        )
    return pairs
