"""A front as a table of 100 columns, and as CSV."""

import csv
import io
from collections.abc import Iterator, Sequence

from planning.model.front import Front, FrontPoint
from planning.model.words import area_words, labelled, percent

_HEAD = (
    "   P   C      lit   measured   at most   of what can be   "
    "sigma [mm]    95 %   frames      Mpx"
)
_NOTES = (
    "lit, measured, at most: of the target. at most: no so many candidates measure",
    "more of the matrix's samples, plus two standard errors. of what can be: of what",
    "these projectors light and some candidate camera measures. sigma: along the",
    "normal, of the median sample measured. * on the front: none is as good in P, C,",
    "measured and 95 %, and better in one. +: meets what is asked",
)


def front_lines(front: Front, name: str, files: Sequence[str]) -> Iterator[str]:
    """Yield what is printed of a front: head, a line a point, what to do with it."""
    reachable, asked = front.reachable_by_projectors_m2, front.asked
    within = percent(reachable / front.area_m2, asked=asked["min_reachable"])
    yield from labelled(
        "FRONT",
        (
            f"{name}: {front.projector_candidates:,} projector and "
            f"{front.camera_candidates:,} camera candidates on {front.samples:,} "
            f"samples; NOT CHECKED",
            f"target {area_words(front.area_m2)}, of which "
            f"{area_words(reachable)} ({within}) can be "
            f"lit; of {front.fresh_samples:,} fresh samples:",
        ),
    )
    yield _HEAD
    yield from (_row(front, point) for point in front.points)
    yield from labelled("READ", _NOTES)
    yield from labelled(
        "ASKED",
        [
            f"lit {percent(asked['dominant_coverage'], decimals=0)} and measured "
            f"{percent(asked['coverage'], decimals=0)} of what can be, "
            f"{percent(asked['region_coverage'], decimals=0)} in every large region; "
            f"{percent(asked['min_reachable'], decimals=0)} can be lit"
        ],
    )
    yield from labelled("TAKE", [_suggested(front)])
    yield from labelled("FILES", files)


def _row(front: Front, point: FrontPoint) -> str:
    lit, measured = (
        percent(area / front.area_m2) for area in (point.lit_m2, point.measured_m2)
    )
    able = point.measured_m2 / (point.reachable_by_cameras_m2 or 1.0)
    of_able = percent(able, asked=front.asked["coverage"])
    exact = [
        "-" if sigma is None else f"{1e3 * sigma:.3f}"
        for sigma in (point.sigma_median_m, point.sigma_p95_m)
    ]
    marks = f"{'*' if point.on_front else ' '}{'+' if point.meets else ' '}"
    megapixels = 1e-6 * point.pixels
    return (
        f"{point.projectors:4}{point.cameras:4}{lit:>9}{measured:>11}"
        f"{percent(front.at_most_share(point)):>10}{of_able:>17}"
        f"{exact[0]:>13}{exact[1]:>8}{point.frames:9}{megapixels:9,.0f} {marks}"
    ).rstrip()


def _suggested(front: Front) -> str:
    """Which point to begin with: the fewest devices that meet what is asked."""
    enough = [point for point in front.points if point.meets]
    if not enough:
        return "none meets what is asked; any may be taken: --take P,C in this folder"
    best = min(enough, key=lambda p: (sum(p.count), p.sigma_p95_m or 0.0))
    return (
        f"--take {best.projectors},{best.cameras} with the same options and -o plans "
        f"the fewest that meet what is asked"
    )


def front_csv(front: Front) -> str:
    """Return every point as a line of CSV, shares of the target, millimetres."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(
        (
            *("projectors", "cameras", "lit_share", "measured_share"),
            *("measured_of_reachable", "at_most_share", "at_most_on_samples"),
            *("at_most_of_these_projectors", "sigma_median_mm", "sigma_p95_mm"),
            *("frames", "pixels", "on_front", "meets"),
        )
    )
    area = front.area_m2
    for one in front.points:
        of_these = one.at_most_of_these_m2
        shares = (
            one.lit_m2 / area,
            one.measured_m2 / area,
            one.measured_m2 / (one.reachable_by_cameras_m2 or 1.0),
            front.at_most_share(one),
            one.at_most_m2 / area,
            None if of_these is None else of_these / area,
        )
        sigmas = (one.sigma_median_m, one.sigma_p95_m)
        writer.writerow(
            (
                *one.count,
                *("" if share is None else f"{share:.4f}" for share in shares),
                *("" if sigma is None else f"{1e3 * sigma:.4f}" for sigma in sigmas),
                *(one.frames, one.pixels, int(one.on_front), int(one.meets)),
            )
        )
    return text.getvalue()
