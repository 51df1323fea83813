"""The paper's route on a scene: its samples, rays and bodies, and its cameras' cover.

The cameras that the route passed join the candidates, so that what is proved of the
number of candidates is true of these, too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.cameras.baselines.widest_baselines import WidestBaselines
from planning.cameras.camera_baselines import (
    BaselineSamples,
    baseline_limits,
    widen_baselines,
)
from planning.cameras.camera_bodies import CameraInterference
from planning.cameras.camera_cover import (
    CameraCover,
    candidate_cover,
    confirmed_cover,
    measured_samples,
    n_fixed,
)
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.errors import InfeasibleLimitsError
from planning.model.words import percent
from planning.proofs.all_poses import BoundQuestion
from planning.proofs.camera_bound import rough_bound
from planning.proofs.selection import CandidateCover, Selection
from planning.scene.draws import DRAWS
from planning.scene.measuring.camera_views import CandidateViews
from planning.scene.measuring.measured import LitSamples, measured_by, taken
from planning.scene.scene import Scene
from solvers import solve_cover

from .paper_route import PaperRoute, paper_route
from .route_problem import Cameras, RouteProblem

# Baseline programs each time baselines are maximised; they are most of what the route
# costs.
_PROGRAMS = 4
_EVALUATIONS = 16
# Counted work for the candidates that measure most.
_BEST = 1e8


@dataclass(frozen=True, eq=False)
class RouteCameras:
    """The route's cameras among the candidates.

    Attributes:
        candidates: Those of the cover, then the cameras that the route passed.
        measured: Which of them measures which sample, shape (n, m).
        by_count: Candidates for each number of cameras that the route passed.
        needed: Cameras with which it measures what is required; None: it ended short.
        best_without_one: Share of what is reachable that the best of one fewer
            measure.
        bounded_on: Samples of which fewer can't be enough anywhere, so that none was
            tried; 0 where that isn't so.
    """

    candidates: CandidateViews
    measured: NDArray[np.bool_]
    by_count: Mapping[int, NDArray[np.int64]]
    needed: int | None
    best_without_one: float
    bounded_on: int = 0

    @property
    def stopped(self) -> str:
        """Why it has no camera fewer."""
        if self.bounded_on:
            return (
                f"fewer can't be enough of its {self.bounded_on} samples, wherever "
                "they stand"
            )
        if not self.best_without_one:
            return ""
        share = percent(self.best_without_one, asked=1.0)
        return f"with one fewer {share} of what is reachable was measured at most"

    @property
    def best(self) -> int:
        """The number of cameras that it needs, or the most that it passed."""
        return self.needed or max(self.by_count)

    @property
    def reached(self) -> float:
        """Share of what is reachable that the most cameras of the route measure."""
        most = self.measured[:, self.by_count[max(self.by_count)]]
        return float(most.any(axis=1).sum() / self.measured.any(axis=1).sum())

    @property
    def cameras(self) -> Cameras:
        """The cameras that it needs, or the most that it passed."""
        chosen = self.by_count[self.best]
        return tuple(self.candidates.cameras[i] for i in chosen)


def cover_by_paper(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    candidates: CandidateViews,
) -> CameraCover:
    """Choose the cameras by the paper's route alone, confirmed on fresh samples.

    Raises:
        InfeasibleLimitsError: If no candidate, or no camera of the route, measures any
            lit sample.
    """

    def choose(samples: LitSamples, measured: NDArray[np.bool_]) -> CameraCover:
        route = route_among(scene, projectors, candidates, samples, measured)
        return cover_of(scene, projectors, samples, route)

    return confirmed_cover(scene, projectors, candidates, choose)


def again_by_paper(
    scene: Scene, projectors: tuple[PlannedProjector, ...], cover: CameraCover
) -> CameraCover:
    """Return the cameras of a route under other ring axes: kept, and measured anew."""
    samples, measured = measured_samples(scene, projectors, cover.candidates)
    route = _judged(
        scene,
        cover.candidates,
        samples,
        measured,
        cover.by_count or {},
        least=1,
        without=0.0,
    )
    return cover_of(scene, projectors, samples, route)


def route_among(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    candidates: CandidateViews,
    samples: LitSamples,
    measured: NDArray[np.bool_],
) -> RouteCameras:
    """Take the paper's route, and judge it on all the samples.

    Raises:
        InfeasibleLimitsError: If the route comes by no camera.
    """
    some = np.arange(
        0, len(samples.target), -(-len(samples.target) // DRAWS.paper_route)
    )
    few = taken(samples, some, samples.lit)
    reachable = np.any(measured[some], axis=1)
    on = BaselineSamples(scene, projectors, few)
    cover = candidate_cover(scene, measured[some], few, candidates.cameras)
    route = paper_route(route_problem(on, candidates, cover))
    if not route.by_count:
        raise InfeasibleLimitsError(
            "the paper's route found no camera that measures a lit sample, though "
            "candidates do; plan with --cameras-by cover"
        )
    joined, by_count = _joined(candidates, route, n_fixed(scene))
    n = len(candidates.cameras)
    views = joined.added_on(samples.target)
    passed = measured_by(scene, joined.cameras[n:], samples, views)
    return _judged(
        scene,
        joined,
        samples,
        np.concatenate([measured, passed], axis=1),
        by_count,
        least=len(route.cameras.cameras),
        without=route.best_without_one / max(1, int(reachable.sum())),
        bounded_on=len(some) if route.bounded else 0,
    )


def _judged(
    scene: Scene,
    candidates: CandidateViews,
    samples: LitSamples,
    measured: NDArray[np.bool_],
    by_count: Mapping[int, NDArray[np.int64]],
    *,
    least: int,
    without: float,
    bounded_on: int = 0,
) -> RouteCameras:
    """Say with how many of its cameras, at least so many, the route is enough."""
    cover = candidate_cover(scene, measured, samples, candidates.cameras)
    enough = (
        n
        for n, chosen in sorted(by_count.items())
        if n >= least and cover.enough(chosen)
    )
    needed = next(enough, None)
    # More samples may ask for more cameras than those that it was bounded on.
    bounded_on = bounded_on if needed == least else 0
    return RouteCameras(candidates, measured, by_count, needed, without, bounded_on)


def route_problem(
    on: BaselineSamples, candidates: CandidateViews, cover: CandidateCover
) -> RouteProblem:
    """Return the route's problem on samples, which candidates cover as stated."""
    scene, n = on.scene, cover.n_existing
    least_lit = on.count_lit(candidates.cameras[:n])
    none = np.zeros((len(on.lit.target), 0), dtype=bool)

    def together(cameras: Sequence[PlannedCamera]) -> NDArray[np.bool_]:
        return on.measured(cameras, least_lit) if cameras else none

    def widen(cameras: Sequence[PlannedCamera]) -> WidestBaselines:
        return widen_baselines(
            on, cameras, max_evaluations=_EVALUATIONS, max_programs=_PROGRAMS
        )

    free = np.asarray(cover.covers[:, :n].any(axis=1))
    required = max(0, cover.quotas.total - int(free.sum()))
    wanted = taken(on.lit, np.flatnonzero(~free), on.lit.lit)

    devices = (candidates.cameras[0].device,)

    def least(count: int) -> int:
        if not required:
            return n
        question = BoundQuestion(required, count - n, len(free), 1.0)
        return n + rough_bound(scene, devices, wanted, question)

    return RouteProblem(
        on.surface,
        baseline_limits(scene),
        candidates.cameras,
        cover.covers,
        together,
        widen,
        cover.quotas,
        lambda count: cover.most_covering(count, None, _BEST)[0],
        least,
        n,
        on.rings,
    )


def _joined(
    candidates: CandidateViews, route: PaperRoute, n_fixed: int
) -> tuple[CandidateViews, dict[int, NDArray[np.int64]]]:
    """The candidates with the route's cameras, and which are those of each count."""
    place = {id(camera): i for i, camera in enumerate(candidates.cameras)}
    passed: list[PlannedCamera] = []
    for _, cameras in sorted(route.by_count.items()):
        for camera in cameras:
            if id(camera) not in place:
                place[id(camera)] = len(candidates.cameras) + len(passed)
                passed.append(camera)
    by_count = {
        count: np.array(
            [*range(n_fixed), *sorted(place[id(c)] for c in cameras[n_fixed:])],
            dtype=np.int64,
        )
        for count, cameras in sorted(route.by_count.items())
    }
    return candidates.joined(tuple(passed)), by_count


def cover_of(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    samples: LitSamples,
    route: RouteCameras,
) -> CameraCover:
    """Return the route's cameras as a cover, bounded over candidates and themselves."""
    cameras = route.candidates.cameras
    among = CameraInterference.among(
        scene, projectors, samples, cameras, route.measured
    )
    return CameraCover(
        route.candidates,
        samples,
        route.measured,
        _selection(scene, samples, route),
        among,
        route.by_count,
        route.stopped,
    )


def _selection(scene: Scene, samples: LitSamples, route: RouteCameras) -> Selection:
    cameras = route.candidates.cameras
    cover = candidate_cover(scene, route.measured, samples, cameras)
    bound = solve_cover(cover.problem, seed=scene.seed, heaviest=False)
    allowed = min(route.best, cover.max_count or route.best)
    chosen = smallest = route.by_count[allowed]
    # A route that ended short shows no number that is enough; a cover does.
    if route.needed is not None:
        smallest = route.by_count[route.needed]
    elif len(bound.selected) > allowed:
        smallest = np.asarray(bound.selected, dtype=np.int64)
    needed = len(smallest)
    least = min(int(np.ceil(bound.lower_bound - 1e-9)), needed)
    _, most = cover.most_covering(allowed, None)
    met = route.needed is not None and allowed == needed
    proved = "optimal" if least >= needed else "feasible"
    return Selection(
        chosen,
        smallest,
        least,
        proved if met else "infeasible",
        bound.proof,
        cover.required,
        cover.n_covered(chosen),
        most,
        min(int(np.ceil(bound.total_bound - 1e-9)), needed),
        floors=cover.floors,
    )
