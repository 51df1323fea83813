"""The front of projectors, cameras, coverage and accuracy, from one matrix."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from geometry.mesh.mesh import TriangleMesh
from geometry.parallel import n_threads
from planning.model.errors import InfeasibleLimitsError
from planning.model.front import Front, FrontPoint, marked
from planning.model.planned import PlannedProjector
from planning.model.progress import Report, Stopwatch
from planning.report.live_bar import shown
from planning.rig.mounted import Mounted
from planning.rig.rig import Rig
from planning.rig.wishes import Wishes
from planning.rings.acquisition import n_frames, pixels_read
from planning.scene.interest import Select, Weight
from planning.scene.ranges.ranged_body import RangedBody
from planning.steps.prepare import prepared, request_of

from .best_counts import BestCount
from .choices import Choice, Chooser
from .fresh_figures import Figures, FreshFigures
from .front_matrix import FrontMatrix, matrix_of
from .front_refused import check_front
from .kept_front import KeptFront

_Count = tuple[int, int]


def plan_front(
    mesh: TriangleMesh | RangedBody,
    rig: Rig,
    wishes: Wishes,
    *,
    select: Select | None = None,
    weight: Weight | None = None,
    fixed: Mounted | None = None,
    seed: int = 0,
    threads: int | None = None,
    time_limit: float | None = None,
    progress: Report | bool = False,
) -> KeptFront:
    """Return what every number of projectors and cameras gives.

    Args:
        mesh: The surface, in metres; a body known by its ranges is refused.
        rig: Devices and limits, from `load_rig`.
        wishes: What is asked; `max_projectors` 0: as many as light nearly all that can
            be lit, `max_cameras` None: as many as then measure nearly all of it, eight
            at most.
        select: As of `plan_rig`.
        weight: As of `plan_rig`.
        fixed: Devices that stay where they are and count, from `read_mounted`.
        seed: The same seed gives the same front.
        threads: Worker threads; no result depends on it. None: one for each core.
        time_limit: Wall time in [s] that ends the run; then there is no front.
        progress: As of `plan_rig`.

    Raises:
        InputError: If an argument can't be used.
        InfeasibleLimitsError: If no device can serve anything.
        TimeLimitError: If the time limit came first.
    """
    rig = rig if fixed is None else fixed.on(rig)
    with (
        shown(progress) as report,
        (clock := Stopwatch(report, time_limit=time_limit)).ticking(),
        threadpool_limits(1),
    ):
        # Any number is looked at; the requirements of a plan have one.
        counted = replace(wishes, max_projectors=wishes.max_projectors or 1)
        request = replace(
            request_of(mesh, rig, counted, clock, select=select, weight=weight),
            seed=seed,
            threads=threads or n_threads(),
            mounted=fixed,
        )
        check_front(request)
        ready = prepared(request, clock)
        matrix = matrix_of(ready, clock)
        ready = replace(ready, request=replace(request, wishes=wishes))
        with clock.stage("covers", "front: the best of each number"):
            chooser = Chooser(ready, matrix)
            choices = chooser.choices(clock)
        if not choices:
            raise InfeasibleLimitsError(
                f"no camera of {len(matrix.cameras)} poses measures anything that "
                f"{max(chooser.lit)} projectors light; `plan --max-projectors "
                f"{max(chooser.lit)}` says which limits stop it"
            )
        with clock.stage("claims", "front: every rig on fresh samples"):
            front, taken = _judged(chooser, choices, clock)
        return KeptFront.of(ready, matrix, front, taken)


def _judged(
    chooser: Chooser, choices: Mapping[_Count, Choice], clock: Stopwatch
) -> tuple[Front, list[PlannedProjector]]:
    """Areas and deviations of every point, none below those of fewer devices.

    Also the projectors of each, point after point.
    """
    matrix, asked = chooser.matrix, chooser.ready.scene.requirements
    fresh = FreshFigures(matrix)
    fresh.look_with(c for choice in choices.values() for c in choice.cameras)
    taken: dict[_Count, tuple[Choice, Figures]] = {}
    for count in sorted(choices):
        clock.check()
        taken[count] = _no_worse(chooser, fresh, choices[count], count, taken)
    lit = np.any([figures.lit for _, figures in taken.values()], axis=0)
    reached = fresh.by_projectors(lit)
    weight = fresh.target.samples.weight
    seen = chooser.seen(max(n for _, n in choices))
    points = tuple(
        _point(
            count,
            choice,
            figures,
            weight=weight,
            at_most=_at_most(chooser.lit, seen, count) * _weight(matrix),
            of_these=None if choice.most is None else choice.most * _weight(matrix),
            meets=_meets(chooser, fresh, figures, reached),
        )
        for count, (choice, figures) in _in_order(taken)
    )
    area = weight * len(fresh.target)
    front = Front(
        area_m2=area,
        reachable_by_projectors_m2=weight * int(reached.sum()),
        samples=len(matrix.target),
        fresh_samples=len(fresh.target),
        projector_candidates=len(matrix.candidates.projectors),
        camera_candidates=len(matrix.cameras),
        asked={
            name: getattr(asked, name)
            for name in (
                *("coverage", "dominant_coverage", "min_reachable"),
                "region_coverage",
            )
        },
        points=marked(points, area),
    )
    every = (choice.projectors for _, (choice, _) in _in_order(taken))
    return front, [projector for some in every for projector in some]


def _in_order(
    taken: Mapping[_Count, tuple[Choice, Figures]],
) -> list[tuple[_Count, tuple[Choice, Figures]]]:
    return [(count, taken[count]) for count in sorted(taken)]


def _weight(matrix: FrontMatrix) -> float:
    return matrix.target.samples.weight


def _no_worse(
    chooser: Chooser,
    fresh: FreshFigures,
    choice: Choice,
    count: _Count,
    taken: Mapping[_Count, tuple[Choice, Figures]],
) -> tuple[Choice, Figures]:
    """A rig with its figures, or a smaller rig that measures more and a device."""
    best = choice, fresh.of(choice)
    fewer = (
        (taken.get((count[0] - 1, count[1])), chooser.with_projector),
        (taken.get((count[0], count[1] - 1)), chooser.with_camera),
    )
    for before, more in fewer:
        if before is None or _measured(before) <= _measured(best):
            continue
        larger = more(before[0])
        trial = larger, fresh.of(larger)
        best = max(best, trial, key=_measured)
    return best


def _measured(judged: tuple[Choice, Figures]) -> int:
    return int(judged[1].measured.sum())


def _at_most(
    lit: Mapping[int, BestCount], seen: Mapping[int, BestCount], count: _Count
) -> int:
    """Samples that no rig of so many candidates measures more of.

    What is measured is lit by some of the projectors, and seen by some of the cameras.
    """
    of_seen = seen.get(count[1]) or seen[max(seen)]
    return min(lit[count[0]].bound, of_seen.bound)


def _point(
    count: _Count,
    choice: Choice,
    figures: Figures,
    *,
    weight: float,
    at_most: float,
    of_these: float | None,
    meets: bool,
) -> FrontPoint:
    sigma = figures.sigma[figures.measured]
    median, p95 = (
        np.quantile(sigma, (0.5, 0.95)).tolist() if len(sigma) else (None,) * 2
    )
    return FrontPoint(
        projectors=count[0],
        cameras=count[1],
        lit_m2=weight * int(figures.lit.sum()),
        measured_m2=weight * len(sigma),
        reachable_by_cameras_m2=weight * int(figures.by_cameras.sum()),
        at_most_m2=at_most,
        at_most_of_these_m2=of_these,
        sigma_median_m=median,
        sigma_p95_m=p95,
        frames=n_frames(choice.projectors, len(choice.cameras)),
        pixels=pixels_read(choice.projectors, choice.cameras),
        meets=meets,
        on_front=False,
        lights=choice.lights,
        views=choice.views,
        axes=choice.axes,
    )


def _meets(
    chooser: Chooser, fresh: FreshFigures, figures: Figures, reached: np.ndarray
) -> bool:
    """Whether fresh samples meet the shares of all, and of every large region."""
    asked = chooser.ready.scene.requirements
    shares = (
        (figures.lit, reached, asked.dominant_coverage),
        (figures.measured, figures.by_cameras, asked.coverage),
    )
    regions = fresh.regions(chooser.ready.scene)
    if reached.sum() < asked.min_reachable * len(reached):
        return False
    return all(
        covered.sum() >= share * able.sum()
        and np.all(
            regions.counts(covered)[1:] >= regions.share * regions.counts(able)[1:]
        )
        for covered, able, share in shares
    )
