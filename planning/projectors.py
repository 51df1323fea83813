"""Section III of the paper: the fewest projectors that light the dominant regions."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.visibility_matrix import visibility_matrix

from . import lighting
from .candidates import projector_candidates, projectors_around
from .errors import InfeasibleLimitsError
from .lighting import Target
from .plan import PlannedProjector
from .relaxations import nothing_lit
from .scene import Scene
from .selection import Selection, certificate, marginals, select_fewest

_ROWS = 2000
_CHECK_ROWS = 4000
_ROUNDS = 3
# Streams of random samples: rows of the cover, then a fresh check set for each round.
_STREAM = 100


@dataclass(frozen=True, eq=False)
class ProjectorStage:
    """What the projector stage found.

    Attributes:
        projectors: The fewest, or the best that are allowed.
        reference: The reference set, which is the candidate set.
        rows: Samples that the cover was solved on.
        stages: First failing limit of each row and candidate.
        by_count: Best candidates for each number of devices, for the marginal table.
        certificate: As in the plan file.
    """

    projectors: tuple[PlannedProjector, ...]
    reference: tuple[PlannedProjector, ...]
    rows: Target
    stages: NDArray[np.int8]
    by_count: dict[int, tuple[PlannedProjector, ...]]
    certificate: dict[str, Any]


def plan_projectors(
    scene: Scene,
    template: PlannedProjector,
    n_candidates: int,
    *,
    ring_offset: tuple[float, float],
    rounds: int = _ROUNDS,
) -> ProjectorStage:
    """Choose the fewest projectors that light the required share of the target.

    The best of a lattice of candidates get more candidates around them, and the cover
    is solved again over all. A minimal cover overfits its samples; so it is tested on
    fresh ones, and where it falls short there, they join the rows and the cover is
    solved once more.

    Args:
        scene: Surface and requirements.
        template: Optics and rings of the projector.
        n_candidates: Poses offered.
        ring_offset: Tilt and azimuth of the ring axis until the cameras are known.
        rounds: Covers at most, each with more rows.

    Raises:
        InfeasibleLimitsError: If no candidate lights any sample.
    """
    required = scene.requirements
    candidates = projector_candidates(
        template, required.workspace, n_candidates, ring_offset=ring_offset
    )
    rows = scene.target_samples(_ROWS, _STREAM)
    stages = lit_stages(scene, candidates, rows)
    if not np.any(stages == lighting.LIT):
        raise InfeasibleLimitsError(nothing_lit(scene, candidates, rows, stages))
    selection = _fewest(scene, stages)
    # The best of a lattice lies beside the best there is.
    around = projectors_around(
        [candidates[i] for i in selection.chosen],
        required.workspace,
        len(candidates),
        ring_offset=ring_offset,
    )
    stages = np.concatenate([stages, lit_stages(scene, around, rows)], axis=1)
    candidates += around
    attempt = 0
    while True:
        attempt += 1
        selection = _fewest(scene, stages)
        fresh = scene.target_samples(_CHECK_ROWS, _STREAM + attempt)
        fresh_stages = lit_stages(scene, candidates, fresh)
        lit = fresh_stages == lighting.LIT
        covered = lit[:, selection.chosen].any(axis=1).sum()
        confirmed = covered >= required.dominant_coverage * lit.any(axis=1).sum()
        if confirmed or selection.status == "infeasible" or attempt == rounds:
            break
        rows = merged(rows, fresh)
        stages = np.concatenate([stages, fresh_stages])
    return _stage(scene, candidates, rows, stages, selection)


def with_more(
    scene: Scene, stage: ProjectorStage, more: tuple[PlannedProjector, ...]
) -> ProjectorStage:
    """Return the stage with more candidates where they need fewer projectors.

    Else it is returned as it was: more candidates alone are no better plan.
    """
    lit = lit_stages(scene, more, stage.rows)
    stages = np.concatenate([stage.stages, lit], axis=1)
    selection = _fewest(scene, stages)
    if selection.needed >= stage.certificate["needed"]["count"]:
        return stage
    return _stage(scene, stage.reference + more, stage.rows, stages, selection)


def _fewest(scene: Scene, stages: NDArray[np.int8]) -> Selection:
    required = scene.requirements
    return select_fewest(
        stages == lighting.LIT,
        required.dominant_coverage,
        max_count=required.max_projectors,
        seed=scene.seed,
    )


def lit_stages(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> NDArray[np.int8]:
    """Return the first failing limit of each sample (row) and projector (column)."""
    stages = np.empty((len(target), len(projectors)), dtype=np.int8)
    for column, projector in enumerate(projectors):
        scene.pulse()
        stages[:, column] = lighting.first_failure_in_the_open(
            projector, target, scene.requirements.projector
        )
    for light in ("diverging", "parallel"):
        alike = [i for i, p in enumerate(projectors) if p.light == light]
        if alike:
            own = [projectors[i] for i in alike]
            stages[:, alike] = _with_shadows(scene, own, target, stages[:, alike])
    return stages


def _with_shadows(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    target: Target,
    stages: NDArray[np.int8],
) -> NDArray[np.int8]:
    """Return the stages of projectors with one kind of light, occlusion included."""
    poses = np.stack([projector.world_from_device for projector in projectors])
    lit = stages == lighting.LIT
    seen = visibility_matrix(
        scene.visibility,
        poses[:, :3, 3],
        target.samples.points,
        target.samples.normals,
        along=poses[:, :3, 2] if projectors[0].light == "parallel" else None,
        candidates=np.ascontiguousarray(lit.T),
    ).dense_transposed()
    return np.where(lit & ~seen, np.int8(lighting.OCCLUDED), stages)


def margins_of(
    scene: Scene, projectors: Sequence[PlannedProjector], target: Target
) -> NDArray[np.float64]:
    """Return the smaller margin of each sample (row) and projector (column) [rad]."""
    margin = np.empty((len(target), len(projectors)))
    limits = scene.requirements.projector
    for column, projector in enumerate(projectors):
        light = lighting.light_on(projector, target)
        margin[:, column] = lighting.margins(light, limits)
    return margin


def merged(first: Target, second: Target) -> Target:
    """Return both sets of samples as one; every sample stands for the same area."""
    a, b = first.samples, second.samples
    total = len(a) * a.weight
    samples = type(a)(
        np.concatenate([a.points, b.points]),
        np.concatenate([a.normals, b.normals]),
        np.concatenate([a.faces, b.faces]),
        total / (len(a) + len(b)),
    )
    return Target(samples, np.concatenate([first.steep, second.steep]))


def _stage(
    scene: Scene,
    candidates: tuple[PlannedProjector, ...],
    rows: Target,
    stages: NDArray[np.int8],
    selection: Selection,
) -> ProjectorStage:
    others = marginals(stages == lighting.LIT, selection, seed=scene.seed)
    proof = certificate(
        selection,
        others,
        n_rows=len(rows),
        row_area_m2=rows.samples.weight,
        n_candidates=len(candidates),
    )
    proof["excluded_pairs"] = {
        cause: int((stages == index).sum())
        for index, cause in enumerate(lighting.CAUSES)
    }
    proof["n_regions"] = int(scene.region.max()) + 1
    return ProjectorStage(
        tuple(candidates[i] for i in selection.chosen),
        candidates,
        rows,
        stages,
        {
            number: tuple(candidates[i] for i in chosen)
            for number, chosen in others.by_count.items()
        },
        proof,
    )
