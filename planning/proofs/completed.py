"""Covers that fresh samples deny, with what these lack."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .selection import CandidateCover, Selection


def completed(
    cover: CandidateCover, selection: Selection, fresh: CandidateCover
) -> Selection:
    """Return a selection with candidates added until it is enough of fresh samples.

    A smallest cover of many devices overfits its samples, however many they are; what
    is proved of these stays, and is of fewer devices. Of a selection of too few it is
    the smallest cover that becomes larger; else no more are added than are allowed.

    Args:
        cover: What candidates cover of the samples that the selection was made on.
        selection: Chosen of them.
        fresh: What the same candidates cover of other samples.
    """
    short = selection.status == "infeasible"
    begun = selection.smallest if short else selection.chosen
    more = greedy_cover(fresh, begun)
    if more is not None and not short:
        more = more[: cover.most]
    if more is None or len(more) == len(begun):
        return selection
    selection = replace(selection, smallest=more, completed=True)
    if short:
        return selection
    return replace(
        selection,
        chosen=more,
        status="feasible",
        n_covered=cover.n_covered(more),
        n_covered_bound=cover.most_covering(len(more), more)[1],
    )


def greedy_cover(
    cover: CandidateCover, begun: NDArray[np.int64]
) -> NDArray[np.int64] | None:
    """Return candidates, and after them those that each add most samples, (k,).

    Of samples that are lacking: of any while the total is, then of regions' alone; of
    candidates that add as many the first. None where none adds any, or no more of it
    is in stock.
    """
    covers, uncovered, taken = cover.covers, ~cover.covered(begun), begun.tolist()
    quotas = cover.quotas
    while not quotas.enough(~uncovered):
        wanted = uncovered & quotas.wanted(~uncovered)
        gains = covers[wanted].sum(axis=0)
        if cover.stock is not None:
            left = cover.stock.left(np.array(taken, dtype=np.int64))
            gains[left[cover.stock.kinds] <= 0] = 0
        best = int(np.argmax(gains))
        if not gains[best] > 0:
            return None
        uncovered &= ~covers[:, best]
        taken.append(best)
    return np.array(taken, dtype=np.int64)
