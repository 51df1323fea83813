"""Sets of samples as bits, row by row, and which rows hold enough of them together."""

from collections.abc import Iterator
from itertools import combinations, islice

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Ints

# Rows of samples, eight to a number.
Bits = NDArray[np.uint8]

_AT_ONCE = 20_000


def packed(rows: NDArray[np.bool_]) -> Bits:
    """Return what columns of samples (n, A) hold, (A, b)."""
    return np.packbits(rows.T, axis=1)


def joined(bits: Bits, sets: Ints) -> Bits:
    """Return what sets (m, k) of rows (A, b) hold together, (m, b)."""
    together = np.zeros((len(sets), bits.shape[1]), dtype=np.uint8)
    for column in sets.T:
        together |= bits[column]
    return together


def held_by(bits: Bits) -> Ints:
    """Return how many samples each row (..., b) holds."""
    return np.bitwise_count(bits).sum(axis=-1, dtype=np.int64)


def subsets(n: int, count: int) -> Iterator[Ints]:
    """Yield all sets of so many of n, many at once, (m, count)."""
    every = combinations(range(n), count)
    while part := list(islice(every, _AT_ONCE)):
        yield np.array(part, dtype=np.int64)


def rows_together(bits: Bits, count: int, asked: int) -> Iterator[tuple[int, ...]]:
    """Yield which rows (n, b), one to three at once, hold enough; the most first."""
    n = len(bits)
    if count == 1:
        held = held_by(bits)
        for k in np.argsort(-held, kind="stable"):
            if held[k] < asked:
                return
            yield (int(k),)
        return
    alone = held_by(bits)
    best = int(alone.max(initial=0))
    found: list[tuple[int, tuple[int, ...]]] = []
    for k in range(n - count + 1):
        if alone[k] + (count - 1) * best < asked:
            continue
        joined = bits[k] | bits[k + 1 :]
        if count == 2:
            held = held_by(joined)
            good = np.flatnonzero(held >= asked)
            found += [(-int(held[j]), (k, k + 1 + int(j))) for j in good]
            continue
        for rest in rows_together(joined, count - 1, asked):
            held = int(held_by(np.bitwise_or.reduce(joined[list(rest)])))
            found.append((-held, (k, *(k + 1 + j for j in rest))))
    for _, chosen in sorted(found):
        yield chosen


def are_enough_together(bits: Bits, count: int, asked: int) -> bool:
    """Whether any so many rows (n, b) hold enough together."""
    alone = held_by(bits)
    if count == 1:
        return bool(np.any(alone >= asked))
    order = np.argsort(-alone, kind="stable")
    bits, alone = bits[order], alone[order]
    return any(
        are_enough_together(bits[k] | bits[k + 1 :], count - 1, asked)
        for k in range(int(np.count_nonzero(count * alone >= asked)))
    )


def rows_of_most(bits: Bits, count: int) -> list[int]:
    """Return rows (n, b) that hold most, each beside those before it."""
    held, chosen = np.zeros(bits.shape[1], dtype=np.uint8), list[int]()
    while len(chosen) < min(count, len(bits)):
        gains = held_by(bits | held)
        gains[chosen] = -1
        chosen.append(int(np.argmax(gains)))
        held |= bits[chosen[-1]]
    return chosen
