"""Move the ring axes, tilt and azimuth, to where the cameras measure most exactly.

`solvers.poses.axis_program` proposes, from the present axis and from its own grid of
starts; the exact predicate decides, on the cover's samples and on fresh ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.poses import inverse, transform
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.scene.codes.patterns import inside_rings
from planning.scene.draws import DRAWS
from planning.scene.lights import light_of
from planning.scene.limits.calibration_terms import calibration_px, surface_deviation
from planning.scene.limits.camera_limits import ViewedSamples
from planning.scene.measuring.camera_views import view_of
from planning.scene.measuring.measurability import expected_noise_px
from planning.scene.measuring.measured import (
    LitSamples,
    least_sigma,
    lit_samples,
    pairs_of,
    taken,
)
from planning.scene.scene import Scene
from solvers.poses.axis_problem import PITCH_POWER, AxisProgram
from solvers.poses.axis_program import better_starts, solve_axis

_SWEEPS = 2
_STEPS = (1.0, 0.5, 0.25)
# Fresh samples reach a little farther than those that the program holds.
_RING_SHARE = 0.99
# Errors that shrink by less aren't worth another axis.
_GAIN = 1e-3
# Where no limit is set the smooth count still needs one.
_LEAST_CONDITIONING = 0.02


def move_ring_axes(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    cameras: Sequence[PlannedCamera],
    samples: LitSamples,
) -> tuple[PlannedProjector, ...]:
    """Return the projectors with the ring axes under which errors are smallest.

    Each projector in turn solves the axis program over samples that it lights; the
    whole way is tried, then a half and a quarter. A move counts only if no fewer
    samples are measured, neither of these nor of fresh ones, all that is lit of the
    surface stays inside the largest ring, and more are measured or the rms of s_N of
    each sample's best pair falls. Projectors that keep their rings keep the axis.
    """
    fresh = lit_samples(scene, projectors, scene.target_samples(DRAWS.axes))
    judges = [AxisJudge.of(scene, cameras, lit) for lit in (samples, fresh)]
    around = lit_samples(scene, projectors, scene.surface_samples(DRAWS.axes))
    points = around.target.samples.points
    held = [points[around.lit[:, p]] for p in range(len(projectors))]
    moved = list(projectors)
    free = [p for p, projector in enumerate(projectors) if not projector.keeps_rings]
    for _ in range(_SWEEPS):
        if not any([_move(judges, moved, p, held[p]) for p in free]):
            break
    return tuple(moved)


@dataclass(frozen=True, eq=False)
class AxisJudge:
    """Lit samples with the rings as they stand, and how each camera sees them.

    `sigma` is each projector's least s_N over the cameras in [m], (n_p, n); inf for
    none.
    """

    scene: Scene
    samples: LitSamples
    views: tuple[ViewedSamples, ...]
    sigma: NDArray[np.float64]

    @classmethod
    def of(
        cls, scene: Scene, cameras: Sequence[PlannedCamera], samples: LitSamples
    ) -> "AxisJudge":
        """Look at lit samples with cameras."""
        views = tuple(view_of(scene, c, samples.target) for c in cameras)
        limits = scene.requirements.triangulation
        each = range(len(samples.lights))
        sigma = np.stack([least_sigma(limits, samples, views, p) for p in each])
        return cls(scene, samples, views, sigma)

    def with_axis(self, projector: PlannedProjector, p: int) -> "AxisJudge":
        """Return the same with another axis of projector p."""
        limits, sigma = self.scene.requirements.triangulation, self.sigma.copy()
        samples = self.samples.with_code(p, projector)
        sigma[p] = least_sigma(limits, samples, self.views, p)
        return replace(self, samples=samples, sigma=sigma)

    def holds(self, projector: PlannedProjector, p: int) -> bool:
        """Whether what a projector lights is inside its largest ring."""
        return inside_rings(
            projector, self.samples.target.samples.points[self.samples.lit[:, p]]
        )


def _move(
    judges: list[AxisJudge],
    moved: list[PlannedProjector],
    p: int,
    held: NDArray[np.float64],
) -> bool:
    """Move one axis if that is better; the judges then go by it."""
    scene, projector = judges[0].scene, moved[p]
    scene.check_cancelled()
    if not judges[0].samples.lit[:, p].any():
        return False
    light = light_of(projector.device)
    for axis in proposals(
        axis_program(scene, moved, p, judges[0].samples, judges[0].views)
    ):
        frame = projector.world_from_device @ light.ring_frame(axis)
        turned = replace(projector, world_from_ring=frame)
        lit = all(judge.holds(turned, p) for judge in judges)
        if not (lit and inside_rings(turned, held)):
            continue
        trials = [judge.with_axis(turned, p) for judge in judges]
        if better([t.sigma for t in trials], [judge.sigma for judge in judges]):
            moved[p], judges[:] = turned, trials
            return True
    return False


def proposals(program: AxisProgram) -> list[NDArray[np.float64]]:
    """Axes to try: the best near the start and partly there, the best far from it.

    Of these the one of largest value comes first. Then follow the better ones of a grid
    of starts as they are: where the program gives up a few samples for smaller errors
    elsewhere, one of them may give up none.
    """
    here, starts = program.start, better_starts(program)
    near = solve_axis(program)
    axes = [here + step * (near.axis - here) for step in _STEPS] if near.moved else []
    if starts:
        far = solve_axis(replace(program, start=starts[0]))
        axes.insert(0 if far.value > near.value else len(axes), far.axis)
    return axes + starts


def better(
    trials: Sequence[NDArray[np.float64]], kept: Sequence[NDArray[np.float64]]
) -> bool:
    """Whether no set has fewer measured, and more are or errors fall, over all sets."""
    after, before = ([np.min(s, axis=0) for s in sets] for sets in (trials, kept))
    now, then = (
        np.array([np.count_nonzero(np.isfinite(least)) for least in sets])
        for sets in (after, before)
    )
    gains = now - then
    if np.any(gains < 0):
        return False
    return bool(np.any(gains > 0)) or _rms(after) < (1.0 - _GAIN) * _rms(before)


def _rms(sigma: Sequence[NDArray[np.float64]]) -> float:
    """Of what is measured, in [m]."""
    every = np.concatenate(sigma)
    measured = every[np.isfinite(every)]
    return float(np.sqrt(np.mean(measured**2))) if len(measured) else 0.0


def axis_program(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    p: int,
    samples: LitSamples,
    views: Sequence[ViewedSamples],
) -> AxisProgram:
    """State the axis program of projector p.

    What the panel's pixels leave of each edge hardly depends on the axis: left out.
    """
    limits, projector = scene.requirements.triangulation, projectors[p]
    pose, light = projector.world_from_device, light_of(projector.device)
    middle = pose @ light.ring_frame(np.zeros(2))
    turn, into = middle[:3, :3], inverse(middle)
    lit = np.flatnonzero(samples.lit[:, p])
    chosen = lit[:: max(1, -(-len(lit) // DRAWS.axis_program))]
    points = samples.target.samples.points
    normals = samples.target.samples.normals[chosen]
    seen = [view.take(chosen) for view in views]
    rays = np.stack([view.rays for view in seen], axis=1)
    facing = np.stack([view.facing for view in seen], axis=1)
    distances = np.stack([view.distances for view in seen], axis=1)
    # g = J_r^T (N r^T + facing I) m, as in `measurability.pair_quality`.
    spread = np.einsum("ij,ikl->ikjl", normals, rays)
    spread += facing[:, :, None, None] * np.eye(3)
    jacobians = np.stack([view.jacobian for view in seen], axis=1)
    slopes = np.einsum("ikja,ikjl->ikal", jacobians, spread)
    errors = limits.limited_calibration
    noise = expected_noise_px(
        limits,
        samples.lights[p].take(chosen),
        samples.surfaces[p].take(chosen),
        float(np.mean(scene.requirements.workspace.camera_radius_m)),
    )
    # A pixel turns a ray by |J| / sqrt 2, whatever the direction, or nearly so.
    per_px = np.maximum(np.linalg.norm(jacobians, axis=(2, 3)), 1e-12) / np.sqrt(2.0)
    turned = calibration_px(errors, distances, per_px) * distances
    levers = samples.surfaces[p].on_average().levers[chosen]
    placed = np.hypot(surface_deviation(errors, levers), limits.ring_sigma_m or 0.0)
    conditioning = max(limits.min_conditioning, _LEAST_CONDITIONING)
    max_sigma, min_pitch = limits.max_sigma_m or np.inf, limits.min_ring_pitch_px or 0.0
    few, others = taken(samples, chosen, samples.lit), np.zeros(len(chosen))
    among = [q for q in range(len(projectors)) if q != p]
    for view in seen:
        for pair in pairs_of(limits, few, view, projectors=among):
            # 1/(1 + e), as `solvers.poses.axis_program` counts a pair.
            quality = pair.quality
            excess = (conditioning / np.maximum(quality.conditioning, 1e-12)) ** 2
            excess += (quality.sigma / max_sigma) ** 2
            pitch = min_pitch / np.maximum(quality.pitch, 1e-12)
            score = 1.0 / (1.0 + excess + pitch ** (2 * PITCH_POWER))
            others[pair.samples] = np.maximum(others[pair.samples], score)
    return AxisProgram(
        light=projector.light,
        points=transform(into, points[chosen]),
        rays=rays @ turn,
        slopes=slopes @ turn,
        seen=np.stack([view.seen for view in seen], axis=1),
        noise=np.hypot(noise[:, None] * distances, turned),
        placement_m=placed[:, None] * np.abs(facing),
        facing=np.abs(facing) / distances,
        others=others,
        held=transform(into, points[lit]),
        start=light.axis_of(inverse(pose) @ projector.world_from_ring),
        ring_radius=_RING_SHARE * float(projector.ring_radii[-1]),
        gap=float(projector.ring_radii[1] - projector.ring_radii[0]),
        min_conditioning=conditioning,
        max_sigma_m=max_sigma,
        min_pitch_px=min_pitch,
    )
