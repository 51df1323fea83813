"""Every point of a front: areas and deviations of fresh samples, and bounds."""

from collections.abc import Mapping

import numpy as np

from planning.model.devices.planned import PlannedProjector
from planning.model.front import Front, FrontPoint, marked
from planning.model.progress import Stopwatch
from planning.rings.acquisition import n_frames, pixels_read

from .best_counts import BestCount
from .choices import Choice, Chooser
from .fresh_figures import Figures, FreshFigures
from .front_matrix import FrontMatrix

_Count = tuple[int, int]


def judged_front(
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
