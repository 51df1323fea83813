"""Section VI of the paper: the fewest cameras that measure what is lit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.document.certificates import Certificate
from planning.model.errors import InfeasibleLimitsError
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.model.words import area_words
from planning.proofs.conflicts import Interference, resolve_others
from planning.proofs.selection import (
    BODIES_LEFT_OUT,
    CandidateCover,
    Selection,
    certificate,
    marginals,
    others_instead,
    select_fewest,
)
from planning.scene.camera_views import CandidateViews
from planning.scene.clearance import candidates_with_clearance
from planning.scene.existing import existing_cameras
from planning.scene.limits import pair_limits
from planning.scene.measured import (
    LitSamples,
    furthest_failure,
    lit_samples,
    measured_by,
)
from planning.scene.samples import Target, merged
from planning.scene.scene import Scene
from planning.scene.workspace.candidates import camera_candidates

from .routes import Routes

_ROWS = 2000
_CHECK_ROWS = 4000
ROUNDS = 3
_STREAM = 200


class NothingMeasuredError(InfeasibleLimitsError):
    """No candidate measures any lit sample.

    Attributes:
        cameras: The candidates.
        rows: The lit samples.
    """

    def __init__(
        self, message: str, cameras: tuple[PlannedCamera, ...], rows: LitSamples
    ) -> None:
        super().__init__(message)
        self.cameras, self.rows = cameras, rows


@dataclass(frozen=True, eq=False)
class CameraCover:
    """Cameras chosen for projectors as they are.

    Attributes:
        offered: Candidates, which are the reference set, and what they see.
        rows: Lit samples that the cover was solved on.
        measured: Which candidate measures which sample, shape (n, m).
        selection: Candidates taken, and what was proved of their number.
        crowd: The candidates among each other's bodies, where they have any.
        by_count: Candidates for each number of them, where a route of its own found
            them; None: the best there are.
    """

    offered: CandidateViews
    rows: LitSamples
    measured: NDArray[np.bool_]
    selection: Selection
    crowd: Interference | None = None
    by_count: Mapping[int, NDArray[np.int64]] | None = None

    @property
    def cameras(self) -> tuple[PlannedCamera, ...]:
        """The cameras taken."""
        return tuple(self.offered.cameras[i] for i in self.selection.chosen)


@dataclass(frozen=True, eq=False)
class CameraStage:
    """What the camera stage found; the attributes are those of `ProjectorStage`.

    `offered` keeps what the reference cameras see, to prove the count again after ring
    axes have moved; `measured`, which of them measures which row, (n, m); `routes` says
    what either route needs.
    """

    cameras: tuple[PlannedCamera, ...]
    offered: CandidateViews
    rows: LitSamples
    measured: NDArray[np.bool_]
    by_count: dict[int, tuple[PlannedCamera, ...]]
    certificate: Certificate
    routes: Routes | None = None

    @property
    def reference(self) -> tuple[PlannedCamera, ...]:
        """The candidates."""
        return self.offered.cameras


def offered_cameras(
    scene: Scene, template: PlannedCamera, n_candidates: int
) -> CandidateViews:
    """Return the candidates, those that stand already first: they are in every cover.

    Args:
        scene: Surface and requirements.
        template: Optics of the camera.
        n_candidates: Poses offered.
    """
    required = scene.requirements
    candidates = existing_cameras(required, template)
    site = scene.site("camera", template.device)

    def lattice(n: int) -> tuple[PlannedCamera, ...]:
        return camera_candidates(template, required.workspace, n, site)

    candidates += candidates_with_clearance(scene, n_candidates, lattice)
    return CandidateViews(scene, candidates)


def plan_cameras(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    offered: CandidateViews,
    known: NDArray[np.int64] | None = None,
) -> CameraCover:
    """Choose the fewest cameras that measure the required share of what is lit.

    Args:
        scene: Surface and requirements.
        projectors: As planned, with their rings.
        offered: Candidates, from `offered_cameras`; what they saw they see again.
        known: Candidates that may do with fewer than the search finds.

    Raises:
        NothingMeasuredError: If no candidate measures any lit sample.
    """
    required = scene.requirements
    target = first_target(scene)
    rows, measured = rows_for(scene, projectors, offered, target)
    refuse_unmeasured(scene, offered, rows, measured)
    attempt = 0
    while True:
        attempt += 1
        selection = select_fewest(candidate_cover(scene, measured), known=known)
        fresh = fresh_target(scene, attempt)
        _, seen = rows_for(scene, projectors, offered, fresh)
        if (
            selection.status == "infeasible"
            or confirms(seen, selection.chosen, required.coverage)
            or attempt == ROUNDS
        ):
            break
        target = merged(target, fresh)
        rows = lit_samples(scene, projectors, target)
        measured = np.concatenate([measured, seen])
    return CameraCover(offered, rows, measured, selection)


def first_target(scene: Scene) -> Target:
    """Return the samples of the target to plan cameras on."""
    return scene.target_samples(_ROWS, _STREAM)


def fresh_target(scene: Scene, attempt: int) -> Target:
    """Return samples that no attempt, counted from 1, has seen before."""
    return scene.target_samples(_CHECK_ROWS, _STREAM + attempt)


def rows_for(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    offered: CandidateViews,
    target: Target,
) -> tuple[LitSamples, NDArray[np.bool_]]:
    """Return the samples that are lit, and which candidate measures which.

    Args:
        scene: Surface and requirements.
        projectors: As planned, with their rings.
        offered: Candidates.
        target: Samples.
    """
    rows = lit_samples(scene, projectors, target)
    return rows, measured_by(scene, offered.cameras, rows, offered.on(rows.target))


def refuse_unmeasured(
    scene: Scene, offered: CandidateViews, rows: LitSamples, measured: NDArray[np.bool_]
) -> None:
    """Refuse to plan where no candidate measures any lit sample.

    Args:
        scene: Surface and requirements.
        offered: Candidates.
        rows: Lit samples.
        measured: Which candidate measures which, shape (n, m).

    Raises:
        NothingMeasuredError: It names the limits that stop most samples.
    """
    if not measured.any():
        said = _nothing_measured(scene, offered.cameras, rows)
        raise NothingMeasuredError(said, offered.cameras, rows)


def confirms(seen: NDArray[np.bool_], chosen: NDArray[np.int64], share: float) -> bool:
    """Return whether candidates measure a share of what all of them do.

    Args:
        seen: Which candidate measures which fresh sample, shape (n, m).
        chosen: Candidates taken.
        share: In (0, 1].
    """
    covered = seen[:, chosen].any(axis=1).sum()
    return bool(covered >= share * seen.any(axis=1).sum())


def camera_stage(scene: Scene, cover: CameraCover) -> CameraStage:
    """Return what the stage found, with the best cameras for every other count."""
    given = n_fixed(scene)
    candidate = candidate_cover(scene, cover.measured)
    others = marginals(candidate, cover.selection)
    if cover.by_count is not None:
        others = others_instead(others, cover.by_count, candidate)
    bodied = cover.crowd is not None and cover.crowd.bodied
    if cover.crowd is not None:
        n = len(cover.selection.chosen)
        others = resolve_others(cover.crowd, candidate, others, n)
    target, candidates = cover.rows.target, cover.offered.cameras
    proof = certificate(
        cover.selection,
        others,
        n_rows=len(target),
        row_area_m2=target.samples.weight,
        n_candidates=len(candidates),
        given=given,
    )
    if bodied:
        proof = proof.changed(bounds_leave_out=BODIES_LEFT_OUT)
    return CameraStage(
        cover.cameras,
        cover.offered,
        cover.rows,
        cover.measured,
        {
            number: tuple(candidates[i] for i in chosen)
            for number, chosen in others.by_count.items()
        },
        proof,
    )


def candidate_cover(scene: Scene, measured: NDArray[np.bool_]) -> CandidateCover:
    """Return what candidates measure, with what is required of cameras.

    Args:
        scene: Requirements and seed.
        measured: Which candidate measures which sample, shape (n, m).
    """
    required = scene.requirements
    return CandidateCover(
        measured,
        required.coverage,
        seed=scene.seed,
        max_count=required.max_cameras,
        n_existing=n_fixed(scene),
    )


def n_fixed(scene: Scene) -> int:
    """Return how many cameras stand already."""
    return len(scene.requirements.existing_of("camera"))


def _nothing_measured(
    scene: Scene, candidates: Sequence[PlannedCamera], rows: LitSamples
) -> str:
    causes = furthest_failure(scene, candidates, rows)
    if len(causes) == 0:
        return (
            "the projectors that were chosen light none of the target's fresh samples, "
            "so no camera measures any; the object may be too small for this rig"
        )
    counts = np.bincount(causes, minlength=pair_limits.MEASURED)
    order = np.argsort(-counts, kind="stable")
    weight = rows.target.samples.weight
    named = ", ".join(
        f"{pair_limits.CAUSES[i]} {100.0 * counts[i] / len(causes):.0f} % "
        f"({area_words(float(weight * counts[i]))})"
        for i in order
        if counts[i] >= 0.01 * len(causes)
    )
    return (
        f"no camera of {len(candidates)} poses measures any lit sample; the limit that "
        f"stops each sample where it comes furthest is {named}"
    )
