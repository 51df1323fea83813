"""The paper's route on a scene: its samples, rays and bodies, and its cameras' cover.

The cameras that the route passed join the candidates, so that what is proved of the
number of candidates is true of these, too.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.cameras.camera_bodies import CameraInterference, lit_among
from planning.cameras.camera_cover import (
    ROUNDS,
    CameraCover,
    candidate_cover,
    confirms,
    first_target,
    fresh_target,
    n_fixed,
    refuse_unmeasured,
    rows_for,
)
from planning.cameras.camera_slides import measured_among, slide_cameras, spread_limits
from planning.model.errors import InfeasibleLimitsError
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.proofs.selection import Selection, required_samples
from planning.scene.camera_views import CandidateViews
from planning.scene.clearance import with_clearance
from planning.scene.existing import movable
from planning.scene.measured import LitSamples, lit_samples, measured_by, taken
from planning.scene.samples import merged
from planning.scene.scene import Scene
from planning.scene.workspace.candidates import cameras_towards, middle_radius_m
from solvers import solve_cover

from .paper_route import PaperRoute, paper_route
from .route_problem import Cameras, RouteProblem

# Samples that the route looks at; what it finds is judged on all.
_ROWS = 1500
# Baseline programs of each slide; they are most of what the route costs.
_PROGRAMS = 4
_EVALUATIONS = 16


@dataclass(frozen=True, eq=False)
class Routed:
    """The route's cameras among the candidates.

    Attributes:
        offered: Candidates, then the cameras that the route passed.
        measured: Which of them measures which sample, shape (n, m).
        by_count: Candidates for each number of cameras that the route passed.
        needed: Cameras with which it measures what is required; None: it ended short.
        best_without_one: Share of what is reachable that one fewer was found to
            measure.
    """

    offered: CandidateViews
    measured: NDArray[np.bool_]
    by_count: Mapping[int, NDArray[np.int64]]
    needed: int | None
    best_without_one: float

    @property
    def reached(self) -> float:
        """Share of what is reachable that the most cameras of the route measure."""
        most = self.measured[:, self.by_count[max(self.by_count)]]
        return float(most.any(axis=1).sum() / self.measured.any(axis=1).sum())

    @property
    def cameras(self) -> Cameras:
        """The cameras that it needs, or the most that it found."""
        chosen = self.by_count[self.needed or max(self.by_count)]
        return tuple(self.offered.cameras[i] for i in chosen)


def cover_by_paper(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    offered: CandidateViews,
    by_count: Mapping[int, NDArray[np.int64]] | None = None,
) -> CameraCover:
    """Choose the cameras by the paper's route alone, confirmed on fresh samples.

    Args:
        scene: With the bodies of the projectors.
        projectors: As planned, with their rings.
        offered: Candidates: they say what is reachable, and what is proved is proved
            over them and the cameras of the route.
        by_count: Candidates that the route passed under other ring axes: they are kept
            and only measured anew; None: the route is taken.

    Raises:
        InfeasibleLimitsError: If no candidate, or no camera of the route, measures any
            lit sample.
    """
    share = scene.requirements.coverage
    target = first_target(scene)
    rows, measured = rows_for(scene, projectors, offered, target)
    refuse_unmeasured(scene, offered, rows, measured)
    if by_count is not None:
        kept = _judged(scene, offered, measured, by_count, 1, 0.0)
        return cover_of(scene, projectors, rows, kept)
    attempt = 0
    while True:
        attempt += 1
        found = route_among(scene, projectors, offered, rows, measured)
        cover = cover_of(scene, projectors, rows, found)
        if cover.selection.status == "infeasible" or attempt == ROUNDS:
            return cover
        fresh = fresh_target(scene, attempt)
        _, seen = rows_for(scene, projectors, cover.offered, fresh)
        if confirms(seen, cover.selection.chosen, share):
            return cover
        target = merged(target, fresh)
        rows = lit_samples(scene, projectors, target)
        measured = np.concatenate([measured, seen[:, : len(offered.cameras)]])


def route_among(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    offered: CandidateViews,
    rows: LitSamples,
    measured: NDArray[np.bool_],
) -> Routed:
    """Take the paper's route, and judge it on all the rows.

    Args:
        scene: With the bodies of the projectors.
        projectors: As planned, with their rings.
        offered: Candidates, those that stand already first.
        rows: Lit samples.
        measured: Which candidate measures which, shape (n, m).

    Raises:
        InfeasibleLimitsError: If the route found no camera.
    """
    some = np.arange(0, len(rows.target), -(-len(rows.target) // _ROWS))
    few = taken(rows, some, rows.lit)
    share = scene.requirements.coverage
    required = required_samples(np.any(measured[some], axis=1), share)
    route = paper_route(_ground(scene, projectors, offered, few, required))
    if not route.by_count:
        raise InfeasibleLimitsError(
            "the paper's route found no camera that measures a lit sample, though "
            "candidates do; plan with --cameras-by cover"
        )
    joined, by_count = _joined(offered, route, n_fixed(scene))
    more = joined.cameras[len(offered.cameras) :]
    sights = joined.on(rows.target)[len(offered.cameras) :]
    theirs = measured_by(scene, more, rows, sights)
    measured = np.concatenate([measured, theirs], axis=1)
    without = route.best_without_one / max(1, int(measured[some].any(axis=1).sum()))
    least = len(route.stand.cameras)
    return _judged(scene, joined, measured, by_count, least, without)


def _judged(
    scene: Scene,
    offered: CandidateViews,
    measured: NDArray[np.bool_],
    by_count: Mapping[int, NDArray[np.int64]],
    least: int,
    without: float,
) -> Routed:
    """Say with how many of its cameras, at least so many, the route is enough."""
    required = required_samples(np.any(measured, axis=1), scene.requirements.coverage)
    enough = [
        n
        for n, chosen in sorted(by_count.items())
        if n >= least and measured[:, chosen].any(axis=1).sum() >= required
    ]
    return Routed(offered, measured, by_count, enough[0] if enough else None, without)


def _ground(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    offered: CandidateViews,
    rows: LitSamples,
    required: int,
) -> RouteProblem:
    samples, space = rows.target.samples, scene.safe_workspace
    template = movable(offered.cameras)[-1]
    site = scene.site("camera", template.device)
    given = offered.cameras[: n_fixed(scene)]
    spared = int(lit_among(projectors, rows, given).any(axis=1).sum())

    def stand(directions: NDArray[np.float64]) -> Cameras:
        return with_clearance(scene, cameras_towards(template, space, directions, site))

    return RouteProblem(
        samples.points,
        samples.normals,
        _of_none(rows, lambda cameras: measured_by(scene, cameras, rows)),
        _of_none(
            rows,
            lambda cameras: measured_among(scene, projectors, cameras, rows, spared),
        ),
        stand,
        lambda cameras: slide_cameras(
            scene,
            projectors,
            cameras,
            rows,
            max_evaluations=_EVALUATIONS,
            max_programs=_PROGRAMS,
        ),
        template.device,
        middle_radius_m(space.camera_radius_m, site),
        spread_limits(scene),
        required,
        given,
    )


def _of_none(
    rows: LitSamples,
    measure: Callable[[Sequence[PlannedCamera]], NDArray[np.bool_]],
) -> Callable[[Sequence[PlannedCamera]], NDArray[np.bool_]]:
    """Measure with no camera, too."""

    def measured(cameras: Sequence[PlannedCamera]) -> NDArray[np.bool_]:
        return measure(cameras) if cameras else np.zeros((len(rows.target), 0), bool)

    return measured


def _joined(
    offered: CandidateViews, route: PaperRoute, given: int
) -> tuple[CandidateViews, dict[int, NDArray[np.int64]]]:
    """The candidates with the route's cameras, and which are those of each count."""
    places: dict[int, int] = {}
    more: list[PlannedCamera] = []
    by_count: dict[int, NDArray[np.int64]] = {}
    for count, cameras in sorted(route.by_count.items()):
        for camera in cameras[given:]:
            if id(camera) not in places:
                places[id(camera)] = len(offered.cameras) + len(more)
                more.append(camera)
        own = [places[id(camera)] for camera in cameras[given:]]
        by_count[count] = np.array([*range(given), *sorted(own)], dtype=np.int64)
    return offered.joined(more), by_count


def cover_of(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    rows: LitSamples,
    found: Routed,
) -> CameraCover:
    """Return the route's cameras as a cover, bounded over candidates and themselves.

    Args:
        scene: With the bodies of the projectors.
        projectors: As planned.
        rows: Lit samples that the route was judged on.
        found: The route.
    """
    crowd = CameraInterference(
        scene, projectors, found.offered.cameras, rows, found.measured
    )
    return CameraCover(
        found.offered,
        rows,
        found.measured,
        _selection(scene, found),
        crowd,
        found.by_count,
    )


def _selection(scene: Scene, found: Routed) -> Selection:
    cover = candidate_cover(scene, found.measured)
    bound = solve_cover(cover.problem, seed=scene.seed, heaviest=False)
    needed = found.needed or max(found.by_count)
    least = min(int(np.ceil(bound.lower_bound - 1e-9)), needed)
    allowed = min(needed, cover.max_count or needed)
    chosen = found.by_count[allowed]
    _, most = cover.most_covering(allowed, None)
    met = found.needed is not None and allowed == needed
    proved = "optimal" if least >= needed else "feasible"
    return Selection(
        chosen,
        found.by_count[needed],
        least,
        proved if met else "infeasible",
        bound.proof,
        cover.required,
        cover.n_covered(chosen),
        most,
    )
