"""Which route to the cameras is taken: the cover's, the paper's, or the better of both.

Both are given the same projectors and ring axes. Where the paper's route, or poses at
the limit (10) of the cover's own cameras, need fewer, they join the candidates and the
cover is solved again, so that what is proved is proved over a pool that holds them.
Where both need as many, the cover's cameras stay, unless the paper's stand clearly
farther apart and measure no less.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from planning.cameras.baselines.camera_spread import CameraSpread
from planning.cameras.baselines.limit_poses import Parts, limit_poses
from planning.cameras.baselines.seams import adjacency, overlap_components
from planning.cameras.paper.paper_cameras import (
    Routed,
    cover_by_paper,
    cover_of,
    route_among,
)
from planning.model.errors import InfeasibleLimitsError
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.proofs.selection import fewest_count
from planning.scene.camera_views import CandidateViews
from planning.scene.clearance import with_clearance
from planning.scene.measured import measured_by, taken
from planning.scene.scene import Scene

from .camera_bodies import resolved_cover
from .camera_cover import (
    CameraCover,
    CameraStage,
    candidate_cover,
    n_fixed,
    plan_cameras,
)
from .camera_slides import (
    reached_by_candidates,
    rows_to_slide_on,
    slide_cameras,
    spread_limits,
)
from .routes import CamerasBy, Routes

# Of a scene, projectors, candidates, and those that a route passed under other axes.
ByCount = Mapping[int, NDArray[np.int64]]
Chooser = Callable[
    [Scene, tuple[PlannedProjector, ...], CandidateViews, ByCount | None], CameraCover
]

# A smallest baseline counts as clearly larger from this ratio on.
_CLEARLY = 1.1
# Samples on which seams are looked for.
_ROWS = 2000


def cover_by_cover(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    offered: CandidateViews,
    known: NDArray[np.int64] | None = None,
) -> CameraCover:
    """Choose the fewest candidates for these ring axes that bear each other's bodies.

    The arguments are those of `plan_cameras`.
    """
    cover = plan_cameras(scene, projectors, offered, known)
    return resolved_cover(scene, projectors, cover)


def chooser(by: CamerasBy) -> Chooser:
    """Return what chooses cameras for projectors: the cover, or the paper's route."""
    return cover_by_paper if by == "paper" else _chosen_anew


def _chosen_anew(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    offered: CandidateViews,
    by_count: ByCount | None = None,
) -> CameraCover:
    """The cover; a cover leaves nothing to keep."""
    return cover_by_cover(scene, projectors, offered)


def passed_by(stage: CameraStage) -> ByCount:
    """Return the candidates for each number of cameras of a stage."""
    place = {id(camera): i for i, camera in enumerate(stage.offered.cameras)}
    return {
        n: np.array([place[id(camera)] for camera in cameras], dtype=np.int64)
        for n, cameras in stage.by_count.items()
    }


def better_route(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    cover: CameraCover,
    by: CamerasBy,
) -> tuple[CameraCover, Routes]:
    """Return the cover that needs fewest cameras, and what either route needs.

    Args:
        scene: With the bodies of the projectors.
        projectors: As planned, ring axes as the cameras were chosen for.
        cover: By the chooser of what was asked.
        by: What was asked.
    """
    if by == "paper":
        cover = _once_more(scene, projectors, cover)
        needed = cover.selection.needed
        met = cover.selection.n_covered >= cover.selection.required
        count = needed if met or needed > len(cover.cameras) else None
        return cover, Routes(
            by, None, count, "paper", "the paper's route was asked for"
        )
    routed = _routed(scene, projectors, cover) if by == "both" else None
    again = _with_more(scene, projectors, cover, routed)
    if routed is not None:
        return again, _compared(scene, cover, again, routed)
    why = "the cover was asked for"
    if by == "both":
        why = "the paper's route found no camera that measures anything"
    return again, Routes(by, again.selection.needed, None, "cover", why)


def _once_more(
    scene: Scene, projectors: tuple[PlannedProjector, ...], cover: CameraCover
) -> CameraCover:
    """Take the paper's route under the final ring axes, if fewer aren't ruled out."""
    if cover.selection.lower_bound >= cover.selection.needed:
        return cover
    again = cover_by_paper(scene, projectors, cover.offered)
    return again if again.selection.needed < cover.selection.needed else cover


def slide_routes(
    scene: Scene,
    projectors: Sequence[PlannedProjector],
    stage: CameraStage,
    *,
    spare_field: float = 0.0,
) -> tuple[CameraStage, CameraSpread]:
    """Slide the cameras apart, or take the paper's where they stand clearly farther.

    Args:
        scene: Surface and requirements.
        projectors: As planned, with even rings.
        stage: Cameras, and those of the paper's route if it needs as many.
        spare_field: What is kept free of the half fields beyond seams [rad]; the
            paper's cameras slid without, so they aren't taken where there is any.
    """
    scene = scene.among(projectors)
    rows = rows_to_slide_on(scene, projectors)
    reached = reached_by_candidates(scene, stage, rows)
    slid = slide_cameras(
        scene,
        projectors,
        stage.cameras,
        rows,
        spare_field=spare_field,
        confirmed=True,
        reached=reached,
    )
    routes = stage.routes
    if spare_field or routes is None or len(routes.rival) != len(stage.cameras):
        return stage, slid
    rival = slide_cameras(
        scene,
        projectors,
        routes.rival,
        rows,
        max_evaluations=1,
        max_programs=0,
        reached=reached,
    )
    if not _clearly_wider(rival, slid):
        return stage, slid
    why = f"as many, {_apart(rival)} instead of {_apart(slid)} apart at the least"
    routes = replace(routes, taken="paper", why=why)
    return replace(stage, cameras=rival.cameras, routes=routes), rival


def _apart(found: CameraSpread) -> str:
    return f"{1e3 * (found.smallest_after_m or 0.0):.0f} mm"


def _clearly_wider(rival: CameraSpread, slid: CameraSpread) -> bool:
    """Whether baselines are larger and nothing is lost: neither area nor overlap."""
    theirs, ours = rival.smallest_after_m, slid.smallest_after_m
    if theirs is None or ours is None or not theirs >= _CLEARLY * ours:
        return False
    rows = [int(s.measured_by.any(axis=1).sum()) for s in (rival, slid)]
    groups = [len(overlap_components(s.measured_by, 1.0)) for s in (rival, slid)]
    return rows[0] >= rows[1] and groups[0] <= groups[1]


def _routed(
    scene: Scene, projectors: tuple[PlannedProjector, ...], cover: CameraCover
) -> Routed | None:
    try:
        return route_among(scene, projectors, cover.offered, cover.rows, cover.measured)
    except InfeasibleLimitsError:
        return None


def _with_more(
    scene: Scene,
    projectors: tuple[PlannedProjector, ...],
    cover: CameraCover,
    routed: Routed | None,
) -> CameraCover:
    """Return the cover over more candidates where they save a camera, else as it was.

    More candidates alone are no better plan. They are the cameras of the paper's route,
    and poses at the limit (10) of the cover's.
    """
    needed = cover.selection.needed
    if needed <= n_fixed(scene) + 1:
        return cover
    offered = cover.offered if routed is None else routed.offered
    measured = cover.measured if routed is None else routed.measured
    limit = _at_limit(scene, cover)
    if limit:
        theirs = measured_by(scene, limit, cover.rows)
        measured = np.concatenate([measured, theirs], axis=1)
        offered = offered.joined(limit)
    known = None
    if routed is not None and (routed.needed or needed) < needed:
        known = routed.by_count[routed.needed or 0]
    if known is None:
        if fewest_count(candidate_cover(scene, measured)) >= needed:
            return cover
    again = cover_by_cover(scene, projectors, offered, known)
    if again.selection.needed < needed:
        return again
    bodied = again.crowd is not None and again.crowd.bodied
    if bodied and routed is not None and known is not None:
        # Completed from the cover's side they were in each other's way, but not so.
        return cover_of(scene, projectors, cover.rows, routed)
    return cover


def _at_limit(scene: Scene, cover: CameraCover) -> tuple[PlannedCamera, ...]:
    """Poses at d_max from each neighbour among the cover's cameras."""
    some = np.arange(0, len(cover.rows.target), -(-len(cover.rows.target) // _ROWS))
    samples = taken(cover.rows, some, cover.rows.lit).target.samples
    chosen = cover.selection.chosen
    parts = Parts(
        samples.points,
        samples.normals,
        adjacency(samples.points, samples.normals),
        cover.measured[np.ix_(some, chosen)],
    )
    return with_clearance(
        scene, limit_poses(cover.cameras, parts, spread_limits(scene))
    )


def _compared(
    scene: Scene, before: CameraCover, after: CameraCover, routed: Routed
) -> Routes:
    """Say what either route needs, and why one of them is taken.

    Args:
        scene: Surface and requirements.
        before: Cover over its own candidates.
        after: Cover as it is kept.
        routed: The paper's route.
    """
    cover, kept, paper = before.selection.needed, after.selection.needed, routed.needed
    if paper is None:
        why = (
            f"the paper's route ended with {_percent(routed.reached)} of what is "
            f"reachable, {_asked(scene)}"
        )
        return Routes("both", kept, None, "cover", why)
    if paper == kept < cover:
        why = "fewer; its cameras stand between the candidates and joined them"
        return Routes("both", cover, paper, "paper", why)
    if paper < kept:
        why = f"with the {paper} of the paper's route fresh samples fall short"
        return Routes("both", kept, None, "cover", why)
    if paper > kept:
        why = (
            f"fewer; without one of its {paper} the paper's route was found to measure "
            f"{_percent(routed.best_without_one)} of what is reachable, {_asked(scene)}"
        )
        return Routes("both", kept, paper, "cover", why)
    why = "as many, and the paper's don't stand clearly farther apart"
    rival = routed.cameras if len(after.cameras) == paper else ()
    return Routes("both", kept, paper, "cover", why, rival)


def _asked(scene: Scene) -> str:
    return f"{100.0 * scene.requirements.coverage:g} % is asked"


def _percent(share: float) -> str:
    # Rounded down: what falls short must not look as if it were enough.
    return f"{np.floor(1e3 * share) / 10.0:.1f} %"
