"""Which device sees which sample, on all cores."""

import numpy as np

from geometry.arrays import Array, Ints, Mask

from .ray_batch import SampleSet, Source
from .rays import equal_parts
from .visibility import BLOCK, Visibility

# Pairs of device and sample that a thread takes on at a time, a byte each.
_GROUP = 1 << 19


def visibility_matrix(
    visibility: Visibility,
    origins: Array,
    points: Array,
    normals: Array,
    *,
    along: Array | None = None,
    candidates: Mask | None = None,
) -> Mask:
    """Return which device (row) sees which sample (column), shape (m, n).

    An entry is set where the pair is a candidate (default: all are) and the segment
    between them is free. A sample that faces away is no candidate: it has ``N . (P - O)
    >= 0``, or ``N . L >= 0`` in parallel light. Limits beyond that are the caller's.

    Devices are shared among the threads. Beside the answer and the prepared samples
    (40 n bytes), a thread holds 3 MB of rays. Arguments are those of
    `Visibility.blocked`, with a row for each device.

    Raises:
        ValueError: If shapes disagree or a number isn't finite.
    """
    samples = visibility.samples(points, normals, sort=True)
    origins = np.asarray(origins, dtype=np.float64)
    shape = (len(origins), len(samples))
    if origins.ndim != 2 or (along is not None and np.shape(along) != origins.shape):
        raise ValueError(f"origins and along must be (m, 3), got {origins.shape}")
    if candidates is not None and candidates.shape != shape:
        raise ValueError(f"candidates must be {shape}, got {candidates.shape}")
    sources = [
        visibility.source(origin, None if along is None else along[index])
        for index, origin in enumerate(origins)
    ]
    seen = np.zeros(shape, dtype=bool)

    def trace(rows: slice) -> None:
        wanted = None if candidates is None else candidates[rows]
        _trace(visibility, samples, sources[rows], wanted, seen[rows])

    most = max(1, _GROUP // max(1, len(samples)))
    caster = visibility.caster
    caster.share(trace, equal_parts(len(origins), most, caster.threads))
    return seen


def _trace(
    visibility: Visibility,
    samples: SampleSet,
    sources: list[Source],
    candidates: Mask | None,
    seen: Mask,
) -> None:
    """Set what some devices see, in the caller's order; `seen` is all false before."""
    batch = visibility.batch()
    waiting: list[tuple[int, Ints]] = []

    def flush() -> None:
        clear, begin = batch.clear(), 0
        for row, places in waiting:
            # One index of one dimension: numpy's quick way to scatter.
            seen[row][places] = clear[begin : begin + len(places)]
            begin += len(places)
        waiting.clear()

    parts = equal_parts(len(samples), BLOCK)
    for row, source in enumerate(sources):
        for part in parts:
            if batch.room < part.stop - part.start:
                flush()
            order = samples.order[part]
            wanted = None if candidates is None else candidates[row].take(order)
            rays = batch.add(samples, part, source, wanted)
            waiting.append((row, order.take(rays)))
    flush()
