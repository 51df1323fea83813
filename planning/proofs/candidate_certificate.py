"""The certificate of a cover over candidates, and of one device more."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from planning.model.document.certificates import (
    BestArea,
    CandidateBound,
    Certificate,
    CountArea,
    NeededCount,
    OneFewer,
)
from planning.scene.placed_bodies import Device, moves_bodies

from .conflicts import Interference, resolve_others
from .marginals import marginals
from .selection import CandidateCover, Selection

_ByCount = Mapping[int, NDArray[np.int64]]
_BODIES_LEFT_OUT = "bodies of chosen devices, which only take away"


def unproved(cover: CandidateCover, sample_area_m2: float) -> Certificate:
    """Return the certificate of existing devices alone, of whose number none is proved.

    What is required is a share of what all candidates cover, as of any cover.
    """
    count = cover.n_existing
    covered = cover.n_covered(np.arange(count))
    area, met = covered * sample_area_m2, cover.enough(np.arange(count))
    return Certificate(
        count=count,
        status="feasible" if met else "infeasible",
        required_m2=cover.required * sample_area_m2,
        n_samples=len(cover.covers),
        candidates=CandidateBound(lower_bound=0, n_candidates=cover.covers.shape[1]),
        continuous=None,
        greedy_count=count,
        needed=NeededCount(count=count, lower_bound=0),
        best_area=BestArea(value_m2=area, upper_bound_m2=area),
        one_fewer=None,
        given=count,
    )


def certified(
    cover: CandidateCover,
    selection: Selection,
    sample_area_m2: float,
    among: Interference | None = None,
    by_count: _ByCount | None = None,
) -> tuple[_ByCount, Certificate]:
    """Return the best candidates for each count, and the certificate of a selection.

    They are those of `by_count`, where there are any, whose bodies are compatible. With
    existing devices, bounds count them, and speak of covers that hold them.
    """
    others = marginals(cover, selection)
    if by_count is not None:
        reported = _of_route(cover, by_count, others.by_count, len(selection.chosen))
        covered = {
            n: (cover.n_covered(c), others.n_covered[n][1]) for n, c in reported.items()
        }
        others = replace(others, by_count=reported, n_covered=covered)
    if among is not None:
        others = resolve_others(among, cover, others, len(selection.chosen))
    n_samples, n_candidates = cover.covers.shape
    count, existing = len(selection.chosen), cover.n_existing
    areas = tuple(
        CountArea(
            count=n,
            value_m2=covered * sample_area_m2,
            upper_bound_m2=bound * sample_area_m2,
        )
        for n, (covered, bound) in sorted(others.n_covered.items())
    )
    bound = CandidateBound(
        lower_bound=min(selection.lower_bound, count),
        n_candidates=n_candidates,
        proof=selection.proof,
    )
    if selection.floors is not None:
        required = selection.required * sample_area_m2
        least = max(selection.total_bound, least_for_total(areas, required))
        bound = bound.changed(for_total=min(least, selection.lower_bound))
    proof = Certificate(
        count=count,
        status=selection.status,
        required_m2=selection.required * sample_area_m2,
        n_samples=n_samples,
        candidates=bound,
        continuous=None,
        greedy_count=others.greedy,
        needed=NeededCount(count=selection.needed, lower_bound=selection.lower_bound),
        by_count=areas,
        best_area=_best_area(areas, count),
        one_fewer=_one_fewer(areas, count, existing),
    )
    extras = {
        "given": existing or None,
        "but_for_bodies": selection.but_for_bodies,
    }
    given = {key: value for key, value in extras.items() if value is not None}
    given |= bodies_left_out(() if among is None else among.devices)
    return others.by_count, proof.changed(**given)


def _of_route(
    cover: CandidateCover, route: _ByCount, best: _ByCount, taken: int
) -> _ByCount:
    """Return the candidates of a route for each count that it passed.

    A route goes by what floors of regions lack, so more of it may cover less than
    fewer do: of such a number, but for the one taken, the best that were found.
    """
    reported: dict[int, NDArray[np.int64]] = {}
    most = 0
    for n in sorted(best.keys() & route.keys()):
        choice = (route[n],)
        if n != taken and cover.n_covered(route[n]) < most:
            choice = route[n], best[n]
        reported[n] = max(choice, key=cover.n_covered)
        most = max(most, cover.n_covered(reported[n]))
    return reported


def bodies_left_out(candidates: Sequence[Device]) -> dict[str, str]:
    """Return `bounds_leave_out` of a certificate; empty where no bodies are chosen."""
    return {"bounds_leave_out": _BODIES_LEFT_OUT} if moves_bodies(candidates) else {}


def least_for_total(by_count: tuple[CountArea, ...], required_m2: float) -> int:
    """Return the least number of which it isn't said that it covers too little."""
    short = required_m2 * (1.0 - 1e-9)
    few = (row.count for row in by_count if row.upper_bound_m2 < short)
    return 1 + max(few, default=0)


def _best_area(by_count: tuple[CountArea, ...], count: int) -> BestArea:
    """What so many devices cover among the candidates."""
    (row,) = (row for row in by_count if row.count == count)
    return BestArea(
        value_m2=row.value_m2, upper_bound_m2=row.upper_bound_m2, scope="candidates"
    )


def _one_fewer(
    by_count: tuple[CountArea, ...], count: int, n_existing: int
) -> OneFewer | None:
    """What one device fewer covers at most; None where all stand already."""
    if count <= n_existing:
        return None
    most = (row.upper_bound_m2 for row in by_count if row.count == count - 1)
    return OneFewer(upper_bound_m2=next(most, 0.0), scope="candidates")


@dataclass(frozen=True, eq=False)
class Refutation:
    """That so many devices, beside existing ones, are too few wherever they stand.

    Attributes:
        n_devices: So many.
        multipliers: Of the first samples of the cover, those of the bound, (n,).
    """

    n_devices: int
    multipliers: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PlannedStage:
    """What was proved of a kind of device, and the best found of each number.

    Attributes:
        refutation: Of what its bound over all poses follows; None: nothing that others
            could follow.
    """

    by_count: Mapping[int, tuple[Any, ...]]
    certificate: Certificate
    refutation: Refutation | None = field(default=None, kw_only=True)


_S = TypeVar("_S", bound=PlannedStage)


def larger(stage: _S, present: Sequence[object], allowed: int | None) -> _S | None:
    """Return a stage whose certificate counts one device more, if that is possible.

    Only for a cover that met its own rows: one that is short of devices anyway has
    said so.
    """
    count, before = len(present) + 1, stage.certificate
    met = before.status != "infeasible"
    if not met or count not in stage.by_count or (allowed or count) < count:
        return None
    if len(stage.by_count[count]) < count:
        return None
    proof = before.changed(
        count=count,
        status="feasible",
        needed=before.needed.changed(count=count),
        best_area=_best_area(before.by_count, count),
        one_fewer=_one_fewer(before.by_count, count, before.given),
    )
    if before.continuous is not None:
        # It bounded one fewer than before.
        unknown = before.continuous.changed(one_fewer_upper_bound_m2=None)
        proof = proof.changed(continuous=unknown)
    return replace(stage, certificate=proof)


def counted(stage: _S, devices: tuple[Any, ...], reachable_m2: float) -> _S:
    """Return a stage with other devices that stand, as many as its cover or more.

    Of more than the cover has nothing is proved: they cover what is reachable at most,
    or what fewer were found to cover where that, of other samples, is more. They are
    planned for more than what they cover, so that fewer may cover more: what covers of
    other numbers give isn't what a device less or more would change.
    """
    before, count = stage.certificate, len(devices)
    if count == before.count:
        return replace(stage, by_count=dict(stage.by_count) | {count: devices})
    rows = tuple(row for row in before.by_count if row.count <= before.count)
    found = max((row.value_m2 for row in rows), default=0.0)
    reachable_m2 = max(reachable_m2, found)
    fewer = OneFewer(upper_bound_m2=reachable_m2)
    if count - 1 == before.count and rows:
        fewer = OneFewer(upper_bound_m2=rows[-1].upper_bound_m2)
    proof = before.changed(
        count=count,
        status="infeasible" if before.status == "infeasible" else "feasible",
        needed=before.needed.changed(count=max(count, before.needed.count)),
        by_count=rows,
        best_area=BestArea(value_m2=found, upper_bound_m2=reachable_m2),
        one_fewer=fewer,
    )
    if before.continuous is not None:
        # It bounded one fewer than before.
        unknown = before.continuous.changed(one_fewer_upper_bound_m2=None)
        proof = proof.changed(continuous=unknown)
    return replace(stage, by_count={count: devices}, certificate=proof)


def unsought(cover: CandidateCover) -> Selection:
    """The existing devices as a selection that nothing was proved of."""
    chosen = np.arange(cover.n_existing)
    n_covered = cover.n_covered(chosen)
    met = cover.enough(chosen)
    return Selection(
        chosen,
        chosen,
        0,
        "feasible" if met else "infeasible",
        "",
        cover.required,
        n_covered,
        n_covered,
    )
