"""Which route to the cameras is taken: the cover's, the paper's, or the better of both.

Both get the same projectors and ring axes. Where the paper's route needs fewer, its
cameras join the candidates and the cover is solved again, so that what is proved is
proved over a set that holds them.
Where both need as many and the paper's measure no less, those stay whose scan is
cheaper by eq. (8); else the cover's, unless the paper's baselines are clearly larger.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planning.cameras.baselines.seams import overlap_components
from planning.cameras.baselines.widest_baselines import WidestBaselines
from planning.cameras.paper.paper_cameras import (
    RouteCameras,
    again_by_paper,
    cover_by_paper,
    cover_of,
    route_among,
)
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.certificates import CamerasBy, RouteCounts
from planning.model.errors import InfeasibleLimitsError
from planning.model.words import percent
from planning.proofs.selection import fewest_count
from planning.scene.measuring.camera_views import CandidateViews
from planning.scene.scene import Scene
from planning.scene.workspace.model_candidates import one_of_each

from .camera_baselines import (
    baseline_samples,
    held_to_candidates,
    widen_baselines,
)
from .camera_bodies import resolved_cover
from .camera_cover import CameraCover, candidate_cover, n_fixed, plan_cameras
from .proved_cameras import CameraStage

_Projectors = tuple[PlannedProjector, ...]
Widened = tuple[CameraStage, WidestBaselines]

# A smallest baseline counts as clearly larger from this ratio on.
_CLEARLY = 1.1


def cover_by_cover(
    scene: Scene,
    projectors: _Projectors,
    candidates: CandidateViews,
    known: NDArray[np.int64] | None = None,
) -> CameraCover:
    """Choose the fewest candidates for these ring axes whose bodies are compatible.

    The arguments are those of `plan_cameras`.
    """
    cover = plan_cameras(scene, projectors, candidates, known)
    return resolved_cover(scene, projectors, cover)


def cover_for(
    scene: Scene, projectors: _Projectors, candidates: CandidateViews, by: CamerasBy
) -> CameraCover:
    """Choose cameras for projectors: by the cover, or by the paper's route."""
    if by == "paper":
        return cover_by_paper(scene, projectors, candidates)
    return cover_by_cover(scene, projectors, candidates)


def cover_again(
    scene: Scene, projectors: _Projectors, cover: CameraCover, by: CamerasBy
) -> CameraCover:
    """Choose cameras for moved ring axes; the paper's stay and are measured anew."""
    if by == "paper":
        return again_by_paper(scene, projectors, cover)
    return cover_by_cover(scene, projectors, cover.candidates)


def better_route(
    scene: Scene, projectors: _Projectors, cover: CameraCover, by: CamerasBy
) -> tuple[CameraCover, RouteCounts, tuple[PlannedCamera, ...]]:
    """Return the cover that needs fewest cameras, and what either route needs.

    Also as many cameras of the paper's route, where the cover's stay.
    """
    if by == "paper":
        why = "proved to be the fewest of the candidates and its own cameras"
        if cover.selection.lower_bound < cover.selection.needed:
            # Other axes may let the route end with fewer.
            again = cover_by_paper(scene, projectors, cover.candidates)
            cover = min(cover, again, key=lambda one: one.selection.needed)
            why = again.stopped or "no fewer were found"
        return cover, _counts(by, cover, why), ()
    route: RouteCameras | None = None
    why = "the cover was asked for"
    if by == "both" and len(one_of_each(cover.candidates.cameras)) > 1:
        why = "the paper's route is of cameras of one model"
    elif by == "both":
        why = "the paper's route found no camera that measures anything"
        try:
            route = route_among(
                scene, projectors, cover.candidates, cover.samples, cover.measured
            )
        except InfeasibleLimitsError:
            pass
    after = _with_more(scene, projectors, cover, route)
    if route is None:
        return after, _counts(by, after, why), ()
    routes = _compared(scene, cover, after, route)
    as_many = routes.paper == routes.cover == len(after.cameras)
    rival = route.cameras if as_many and routes.taken == "cover" else ()
    return after, routes, rival


def _counts(by: CamerasBy, cover: CameraCover, why: str) -> RouteCounts:
    """What is said where one route alone was taken."""
    needed = cover.selection.needed
    if by != "paper":
        return RouteCounts(asked=by, cover=needed, paper=None, taken="cover", why=why)
    met = cover.selection.status != "infeasible"
    # Where fewer are allowed, those that suffice are the route's, or of a cover.
    own = (cover.by_count or {}).get(needed, np.empty(0, dtype=np.int64))
    enough = needed > len(cover.cameras) and np.isin(cover.selection.smallest, own)
    count = needed if met or np.all(enough) else None
    why = "it ended with less than is asked" if count is None else why
    return RouteCounts(asked=by, cover=None, paper=count, taken="paper", why=why)


def widest_routes(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    stage: CameraStage,
    *,
    spare_field: float = 0.0,
) -> tuple[Widened, ...]:
    """Return the cameras with maximised baselines, the better of two routes first.

    The paper's as many cameras are the other, unless something is lost by them; where
    they stand clearly farther apart they are the better.

    `spare_field` [rad] of the half fields is kept free beyond seams. The paper's
    cameras moved without, so they aren't taken where there is any.
    """
    samples = held_to_candidates(
        baseline_samples(scene.among(projectors), projectors),
        stage.reference,
        stage.cover.samples,
        stage.cover.measured,
    )
    widest = widen_baselines(
        samples, stage.cameras, spare_field=spare_field, confirmed=True
    )
    routes = stage.routes
    if spare_field or routes is None or len(stage.rival) != len(stage.cameras):
        return ((stage, widest),)
    rival = widen_baselines(samples, stage.rival, max_evaluations=1, max_programs=0)
    if _loses(rival, widest):
        return ((stage, widest),)
    why = f"as many, {_apart(rival)} instead of {_apart(widest)} apart at the least"
    routes = routes.changed(taken="paper", why=why)
    other = replace(stage, cameras=rival.cameras, routes=routes), rival
    if _clearly_wider(rival, widest):
        return other, (stage, widest)
    return (stage, widest), other


def cheapest(
    solutions: Sequence[tuple[CameraStage, int]],
) -> tuple[int, CameraStage]:
    """Return which of as many cameras costs least, the first of equals, and why.

    Each comes with its pixels times frames.
    """
    costs = [cost for _, cost in solutions]
    best = costs.index(min(costs))
    stage = solutions[best][0]
    if best == 0 or stage.routes is None:
        return best, stage
    why = f"as many, and {1.0 - costs[best] / costs[0]:.1%} fewer pixels to read"
    return best, replace(stage, routes=stage.routes.changed(why=why))


def _apart(baselines: WidestBaselines) -> str:
    return f"{1e3 * (baselines.smallest_after_m or 0.0):.0f} mm"


def _clearly_wider(rival: WidestBaselines, widest: WidestBaselines) -> bool:
    theirs, ours = rival.smallest_after_m, widest.smallest_after_m
    return theirs is not None and ours is not None and theirs >= _CLEARLY * ours


def _loses(rival: WidestBaselines, widest: WidestBaselines) -> bool:
    """Whether a rival measures less, or its parts overlap less."""
    counts = [int(s.measured_by.any(axis=1).sum()) for s in (rival, widest)]
    groups = [len(overlap_components(s.measured_by)) for s in (rival, widest)]
    return counts[0] < counts[1] or groups[0] > groups[1]


def _with_more(
    scene: Scene,
    projectors: _Projectors,
    cover: CameraCover,
    route: RouteCameras | None,
) -> CameraCover:
    """Return the cover over the route's cameras, too, where they save a camera.

    More candidates alone are no better plan.
    """
    needed = cover.selection.needed
    if route is None or needed <= n_fixed(scene) + 1:
        return cover
    known = None
    if route.needed is not None and route.needed < needed:
        known = route.by_count[route.needed]
    else:
        cameras = route.candidates.cameras
        joined = candidate_cover(scene, route.measured, cover.samples, cameras)
        if needed <= fewest_count(joined):
            return cover
    again = cover_by_cover(scene, projectors, route.candidates, known)
    if again.selection.needed < needed:
        return again
    if again.has_bodies and known is not None:
        # Completed from the cover's side they were in each other's way, but not so.
        return cover_of(scene, projectors, cover.samples, route)
    return cover


def _compared(
    scene: Scene, before: CameraCover, after: CameraCover, route: RouteCameras
) -> RouteCounts:
    """Say what either route needs, and why one of them is taken."""
    cover, kept, paper = before.selection.needed, after.selection.needed, route.needed
    asked = scene.requirements.coverage
    required = f"{100.0 * asked:g} % is asked"
    taken, why = "cover", "as many, and the paper's don't stand clearly farther apart"
    if paper is None:
        share = percent(route.reached, asked=asked)
        why = f"the paper's route ended with {share} of what is reachable, {required}"
    elif paper == kept < cover:
        why = "fewer; its cameras stand between the candidates and joined them"
        taken, kept = "paper", cover
    elif paper < kept:
        why = f"with the {paper} of the paper's route fresh samples fall short"
        paper = None
    elif paper > kept:
        why = f"fewer; of the {paper} by the paper's route: {route.stopped}, {required}"
    return RouteCounts(asked="both", cover=kept, paper=paper, taken=taken, why=why)
