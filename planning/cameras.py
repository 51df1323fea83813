"""Section VI of the paper: the fewest cameras that measure what is lit."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.visibility_matrix import visibility_matrix

from . import lighting, measurability
from .candidates import camera_candidates
from .errors import InfeasibleLimitsError
from .existing import existing_cameras
from .lighting import Light, Target
from .measurability import Rings
from .plan import PlannedCamera, PlannedProjector
from .projectors import lit_stages, merged
from .scene import Scene
from .selection import Selection, certificate, marginals, select_fewest

_ROWS = 2000
_CHECK_ROWS = 4000
_ROUNDS = 3
_STREAM = 200
# Of a cosine: what this decides roughly, `measurability.view` decides exactly.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class LitSamples:
    """Samples with the light of every projector of the plan on them.

    Attributes:
        target: The samples that at least one projector lights.
        lit: Which projector lights which, shape (n, n_projectors).
        lights: Light of each projector.
        rings: Ring surfaces of each projector.
    """

    target: Target
    lit: NDArray[np.bool_]
    lights: tuple[Light, ...]
    rings: tuple[Rings, ...]


@dataclass(frozen=True, eq=False)
class CameraCover:
    """Cameras chosen for projectors as they are.

    Attributes:
        candidates: Poses offered, which are the reference set.
        rows: Lit samples that the cover was solved on.
        measured: Which candidate measures which sample, shape (n, m).
        selection: Candidates taken, and what was proved of their number.
    """

    candidates: tuple[PlannedCamera, ...]
    rows: LitSamples
    measured: NDArray[np.bool_]
    selection: Selection

    @property
    def cameras(self) -> tuple[PlannedCamera, ...]:
        """The cameras taken."""
        return tuple(self.candidates[i] for i in self.selection.chosen)


@dataclass(frozen=True, eq=False)
class CameraStage:
    """What the camera stage found; the attributes are those of `ProjectorStage`."""

    cameras: tuple[PlannedCamera, ...]
    reference: tuple[PlannedCamera, ...]
    rows: LitSamples
    by_count: dict[int, tuple[PlannedCamera, ...]]
    certificate: dict[str, Any]


def lit_samples(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> LitSamples:
    """Return the samples that the projectors light, with their light and rings."""
    lit = lit_stages(scene, projectors, target) == lighting.LIT
    some = np.flatnonzero(lit.any(axis=1))
    kept = target.take(some)
    return LitSamples(
        kept,
        lit[some],
        tuple(lighting.light_on(projector, kept) for projector in projectors),
        rings_of(projectors, kept),
    )


def rings_of(
    projectors: Sequence[PlannedProjector], target: Target
) -> tuple[Rings, ...]:
    """Return the ring surfaces of every projector at samples."""
    points = target.samples.points
    return tuple(measurability.rings_at(projector, points) for projector in projectors)


def measured_by(
    scene: Scene, cameras: Sequence[PlannedCamera], rows: LitSamples
) -> NDArray[np.bool_]:
    """Return which camera measures which sample with any projector, (n, n_cameras)."""
    samples = rows.target.samples
    pairs = [_measurable(scene, camera, rows) for camera in cameras]
    return visibility_matrix(
        scene.visibility,
        np.stack([camera.world_from_device[:3, 3] for camera in cameras]),
        samples.points,
        samples.normals,
        candidates=np.stack(pairs),
    ).dense_transposed()


def plan_cameras(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    template: PlannedCamera,
    n_candidates: int,
) -> CameraCover:
    """Choose the fewest cameras that measure the required share of what is lit.

    Args:
        scene: Surface and requirements.
        projectors: As planned, with their rings.
        template: Optics of the camera.
        n_candidates: Poses offered.

    Raises:
        InfeasibleLimitsError: If no candidate measures any lit sample.
    """
    required = scene.requirements
    # Those that stand already come first, and are in every cover.
    candidates = existing_cameras(required, template)
    candidates += camera_candidates(template, required.workspace, n_candidates)
    target = scene.target_samples(_ROWS, _STREAM)
    rows = lit_samples(scene, projectors, target)
    measured = measured_by(scene, candidates, rows)
    if not measured.any():
        raise InfeasibleLimitsError(_nothing_measured(scene, candidates, rows))
    attempt = 0
    while True:
        attempt += 1
        selection = select_fewest(
            measured,
            required.coverage,
            max_count=required.max_cameras,
            seed=scene.seed,
            given=_n_given(scene),
        )
        fresh_target = scene.target_samples(_CHECK_ROWS, _STREAM + attempt)
        fresh = lit_samples(scene, projectors, fresh_target)
        seen = measured_by(scene, candidates, fresh)
        covered = seen[:, selection.chosen].any(axis=1).sum()
        confirmed = covered >= required.coverage * seen.any(axis=1).sum()
        if confirmed or selection.status == "infeasible" or attempt == _ROUNDS:
            break
        target = merged(target, fresh_target)
        rows = lit_samples(scene, projectors, target)
        measured = np.concatenate([measured, seen])
    return CameraCover(candidates, rows, measured, selection)


def camera_stage(scene: Scene, cover: CameraCover) -> CameraStage:
    """Return what the stage found, with the best cameras for every other count."""
    given = _n_given(scene)
    others = marginals(cover.measured, cover.selection, seed=scene.seed, given=given)
    target = cover.rows.target
    return CameraStage(
        cover.cameras,
        cover.candidates,
        cover.rows,
        {
            number: tuple(cover.candidates[i] for i in chosen)
            for number, chosen in others.by_count.items()
        },
        certificate(
            cover.selection,
            others,
            n_rows=len(target),
            row_area_m2=target.samples.weight,
            n_candidates=len(cover.candidates),
            given=given,
        ),
    )


def _n_given(scene: Scene) -> int:
    return len(scene.requirements.existing_of("camera"))


def _measurable(
    scene: Scene, camera: PlannedCamera, rows: LitSamples
) -> NDArray[np.bool_]:
    """Whether a camera measures each sample, were there nothing in between."""
    scene.pulse()
    required = scene.requirements
    # Most of what a candidate can't see faces away from it.
    facing = _facing(camera, rows.target, required.camera.max_incidence)
    target = rows.target.take(facing)
    seen = measurability.view(camera, target, required.camera, None)
    measured = np.zeros(len(target), dtype=bool)
    for p, (light, rings) in enumerate(zip(rows.lights, rows.rings, strict=True)):
        lit = (seen.stage == measurability.SEEN) & rows.lit[facing, p]
        open_pairs = np.flatnonzero(lit & ~measured)
        quality = measurability.pair_quality(
            target.samples.normals[open_pairs],
            light.take(facing[open_pairs]),
            rings.take(facing[open_pairs]),
            seen.take(open_pairs),
            required.triangulation,
        )
        stage = measurability.first_pair_failure(quality, required.triangulation)
        measured[open_pairs[stage == measurability.MEASURED]] = True
    wanted = np.zeros(len(rows.target), dtype=bool)
    wanted[facing[measured]] = True
    return wanted


def _facing(
    camera: PlannedCamera, target: Target, max_incidence: float
) -> NDArray[np.int64]:
    """Samples that a camera may meet within the incidence limit, rounding allowed."""
    offsets = target.samples.points - camera.world_from_device[:3, 3]
    along = -np.einsum("ij,ij->i", offsets, target.samples.normals)
    distances = np.sqrt(np.einsum("ij,ij->i", offsets, offsets))
    return np.flatnonzero(along >= (np.cos(max_incidence) - _ROUNDING) * distances)


def furthest_failure(
    scene: Scene, cameras: Sequence[PlannedCamera], rows: LitSamples
) -> NDArray[np.int8]:
    """Return how far each sample comes over all pairs: an index in `CAUSES`.

    It is `MEASURED` where some pair measures the sample.
    """
    furthest = np.zeros(len(rows.target), dtype=np.int8)
    required = scene.requirements
    for camera in cameras:
        scene.pulse()
        seen = measurability.view(
            camera, rows.target, required.camera, scene.visibility
        )
        furthest = np.maximum(furthest, seen.stage)
        clear = np.flatnonzero(seen.stage == measurability.SEEN)
        for p, (light, rings) in enumerate(zip(rows.lights, rows.rings, strict=True)):
            pairs = clear[rows.lit[clear, p]]
            quality = measurability.pair_quality(
                rows.target.samples.normals[pairs],
                light.take(pairs),
                rings.take(pairs),
                seen.take(pairs),
                required.triangulation,
            )
            stage = measurability.first_pair_failure(quality, required.triangulation)
            furthest[pairs] = np.maximum(furthest[pairs], stage)
    return furthest


def _nothing_measured(
    scene: Scene, candidates: Sequence[PlannedCamera], rows: LitSamples
) -> str:
    causes = furthest_failure(scene, candidates, rows)
    if len(causes) == 0:
        return (
            "the projectors that were chosen light none of the target's fresh samples, "
            "so no camera measures any; the object may be too small for this rig"
        )
    counts = np.bincount(causes, minlength=measurability.MEASURED)
    order = np.argsort(-counts, kind="stable")
    named = ", ".join(
        f"{measurability.CAUSES[i]} {100.0 * counts[i] / len(causes):.0f} %"
        for i in order
        if counts[i] >= 0.01 * len(causes)
    )
    return (
        f"no camera of {len(candidates)} poses measures any lit sample; the limit that "
        f"stops each sample where it comes furthest is {named}; relax it (sigma is "
        f"--accuracy, the others stand in the rig file)"
    )
