"""What each limit of a camera must be, all others as they are, for it to measure.

A sample that exactly one limit forbids asks something of that limit; one that two
forbid is helped by neither alone.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.devices import PinholeModel
from geometry.poses import inverse, transform
from planning.model.planned import PlannedCamera
from planning.model.requirements import CameraLimits, TriangulationLimits
from planning.scene import measurability
from planning.scene.limits import camera_limits, pair_limits
from planning.scene.limits.camera_limits import SEEN, ViewedSamples
from planning.scene.limits.pair_limits import CAUSES
from planning.scene.measured import LitSamples
from planning.scene.scene import Scene

from .camera_knobs import STEEPEST, Pairs, Relaxation

# An image no wider than so many times is worth asking for.
_WIDER = 3
_OCCLUDED = CAUSES.index("camera_occlusion")
_COARSE = CAUSES.index("sample_distance")
# Limits that can give way, in the order of `_Sight.failed` and `_failed`.
_LIFTED = (0, 1, 2, _COARSE, SEEN, SEEN + 1, SEEN + 2)


@dataclass(frozen=True, eq=False)
class Demands:
    """One camera and every projector on n lit samples.

    Attributes:
        furthest: Index in `CAUSES` of the limit at which the sample comes furthest,
            `MEASURED` where it is measured, shape (n,).
        asked: What a sample asks of each knob: -inf where it is measured as it is, inf
            where the knob alone doesn't help, shape (n_knobs, n).
    """

    furthest: NDArray[np.int8]
    asked: NDArray[np.float64]


def demands(
    scene: Scene, camera: PlannedCamera, rows: LitSamples, knobs: tuple[Relaxation, ...]
) -> Demands:
    """Return what lit samples ask of the limits at a camera's pose.

    Args:
        scene: With the bodies that stand in the way.
        camera: As it stands.
        rows: Lit samples.
        knobs: Limits that may give way.
    """
    scene.check_cancelled()
    sight = _sight(scene, camera, rows)
    limits, normals = scene.requirements.triangulation, rows.target.samples.normals
    furthest = sight.stage.copy()
    asked = np.full((len(knobs), len(rows.target)), np.inf)
    near = np.flatnonzero(sight.clear & (sight.failed.sum(axis=0) <= 1))
    for p in range(len(rows.lights)):
        own = near[rows.lit[near, p]]
        quality = measurability.pair_quality(
            normals[own],
            rows.lights[p].take(own),
            rows.rings[p].take(own),
            sight.view.take(own),
            limits,
        )
        seen = sight.stage[own] == SEEN
        stage = measurability.first_pair_failure(quality, limits)
        furthest[own[seen]] = np.maximum(furthest[own[seen]], stage[seen])
        failed = np.concatenate([sight.failed[:, own], _failed(quality, limits)])
        asked[:, own[~failed.any(axis=0)]] = -np.inf
        alone, pairs = failed.sum(axis=0) == 1, sight.pairs(own, quality)
        for k, knob in enumerate(knobs):
            index = np.flatnonzero(alone & failed[_LIFTED.index(knob.cause)])
            asks = knob.ask(pairs.take(index))
            asked[k, own[index]] = np.minimum(asked[k, own[index]], asks)
    return Demands(furthest, asked)


@dataclass(frozen=True, eq=False)
class _Sight:
    """How a camera stands to samples, whatever its limits forbid.

    Attributes:
        view: With no limits but what stands in between.
        clear: Whether nothing does.
        stage: First limit of *seen* that fails, `SEEN` if none, as in a
        `ViewedSamples`. failed: Whether field, range, incidence and sampling distance
        fail, (4, n). off_axis: From the middle of the image [rad].
        sample_distance: z / (f cos(incidence)) [m].
    """

    view: ViewedSamples
    clear: NDArray[np.bool_]
    stage: NDArray[np.int8]
    failed: NDArray[np.bool_]
    off_axis: NDArray[np.float64]
    sample_distance: NDArray[np.float64]

    def pairs(self, own: NDArray[np.int64], quality: pair_limits.PairQuality) -> Pairs:
        """Return a pair on some samples, of which the quality is given."""
        return Pairs(
            self.view.distances[own],
            np.arccos(np.clip(self.view.facing[own], -1.0, 1.0)),
            self.off_axis[own],
            self.sample_distance[own],
            quality.conditioning,
            quality.sigma,
            quality.pitch,
        )


def _sight(scene: Scene, camera: PlannedCamera, rows: LitSamples) -> _Sight:
    limits, device = scene.requirements.camera, camera.device
    view = _lifted_view(scene, camera, rows)
    local = transform(inverse(camera.world_from_device), rows.target.samples.points)
    low, high = device.range_m
    step = local[:, 2] / (device.focal_px * np.maximum(view.facing, 1e-9))
    coarsest = limits.max_sample_distance_m
    failed = ~np.stack(
        [
            device.contains(device.project(local)),
            (view.distances >= low) & (view.distances <= high),
            view.facing >= np.cos(limits.max_incidence),
            step <= (np.inf if coarsest is None else coarsest),
        ]
    )
    stage = np.where(failed[3], np.int8(_COARSE), np.int8(SEEN))
    between = np.isin(view.stage, (_OCCLUDED, camera_limits.BLOCKED))
    np.copyto(stage, view.stage, where=between)
    for index in (2, 1, 0):
        stage[failed[index]] = index
    middle = device.rays(0.5 * (np.array(device.resolution) - 1.0))
    along = local @ middle / np.maximum(view.distances, 1e-12)
    off_axis = np.arccos(np.clip(along, -1.0, 1.0))
    return _Sight(view, view.stage == SEEN, stage, failed, off_axis, step)


def _failed(
    quality: pair_limits.PairQuality, limits: TriangulationLimits
) -> NDArray[np.bool_]:
    """Whether |r.m|, s_N and pitch fail, each by itself, shape (3, n)."""
    largest, least = limits.max_sigma_m, limits.min_ring_pitch_px
    return ~np.stack(
        [
            quality.conditioning >= limits.min_conditioning,
            quality.sigma <= (np.inf if largest is None else largest),
            quality.pitch >= (-np.inf if least is None else least),
        ]
    )


def _lifted_view(
    scene: Scene, camera: PlannedCamera, rows: LitSamples
) -> ViewedSamples:
    """How a camera would see samples without any limit but what stands between."""
    wide = replace(camera, device=_widened(camera.device))
    return measurability.view(
        wide,
        rows.target,
        CameraLimits(max(STEEPEST, scene.requirements.camera.max_incidence)),
        scene.visibility,
        scene.standing,
    )


def _widened(device: PinholeModel) -> PinholeModel:
    width, height = device.resolution
    matrix = device.camera_matrix.copy()
    matrix[:2, 2] += 0.5 * (_WIDER - 1) * np.array([width, height])
    return replace(
        device,
        camera_matrix=matrix,
        resolution=(_WIDER * width, _WIDER * height),
        range_m=(0.0, np.inf),
    )
