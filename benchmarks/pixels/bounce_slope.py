"""One bounce of light as the check predicts it, against what Mitsuba moves.

The sample head, a matt object that gives back 80 %, is rendered with no bounce and with
one, without sensor noise and on the same paths. Of the edges found in both, how far
points moved along the normal, t, is held against two predictions of other random
directions, p and q. A regression on p alone is drawn towards 0 by p's own sampling
error; with the other as instrument, which errs otherwise, it isn't::

    slope = cov(q, t) / cov(q, p),   correlation = cov(q, t) / sqrt(var(t) cov(q, p))

    PYTHONPATH=.:tests python -m benchmarks.pixels.bounce_slope [PATHS]

with 48 paths a pixel, or so many.
"""

import sys

import numpy as np
from scipy.spatial import KDTree

from benchmarks.pixels.mitsuba_beside import head, rig
from geometry.rays.proximity import closest_points
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.check.interreflection import ALBEDO, shifts
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.reconstruct import reconstruct
from planning.verify.reconstruction.render.mitsuba.materials import Surface
from planning.verify.reconstruction.render.mitsuba.physics import Physics
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.scanner import Scanner

# Edges of both images are the same this near to each other [px].
_SAME_PX = 0.5
_CELL_M = 0.01
_FEWEST = 10
# Directions followed from each edge: the check's few leave cells too vague to compare.
_DIRECTIONS = 128
# Bits with edges enough; bit 0 holds the finest rings, every other edge.
_BITS = 5


def clouds(scanner: Scanner, spp: int) -> list[Cloud]:
    """Return all points without and with one bounce, the same edges in one order."""
    light = Photometry(noisy=False)
    surface = Surface(albedo=ALBEDO, texture=0.0)
    first, second = (
        reconstruct(
            scanner,
            seed=0,
            photometry=light,
            physics=Physics(bounces=bounces, spp=spp, surface=surface),
        ).everything
        for bounces in (0, 1)
    )
    places = [
        np.column_stack([c.pixels, 1e3 * c.ring, 1e5 * c.camera])
        for c in (first, second)
    ]
    away, nearest = KDTree(places[1]).query(places[0], distance_upper_bound=_SAME_PX)
    found = np.flatnonzero(np.isfinite(away))
    return [first.take(found), second.take(np.asarray(nearest)[found])]


def slopes(t: Array, p: Array, q: Array) -> str:
    """Return cells of the table: slope by p alone, by both, correlation by both."""
    cov = np.cov(np.stack([t, p, q]))
    both = cov[1, 2]
    plain = 0.5 * (cov[0, 1] / cov[1, 1] + cov[0, 2] / cov[2, 2])
    shared = 0.5 * (cov[0, 1] + cov[0, 2])
    return (
        f"{plain:.2f} | {shared / both:.2f} | {shared / np.sqrt(cov[0, 0] * both):.2f}"
    )


def main(spp: int) -> None:
    """Print the table."""
    scanner = rig(head(), 2400.0)
    before, after = clouds(scanner, spp)
    near = [closest_points(scanner.mesh, c.points) for c in (before, after)]
    t = near[1].distances - near[0].distances
    halves = [
        shifts(scanner, before, ALBEDO, np.random.default_rng(seed), _DIRECTIONS)[0]
        for seed in (1, 2)
    ]
    fine = np.isfinite(t) & np.isfinite(halves[0]) & np.isfinite(halves[1])
    t, (p, q) = t[fine], (half[fine] for half in halves)
    print(f"Head, {spp} paths a pixel, {len(t)} edges; outside is positive\n")
    print(
        "| what | number | moved, rms [mm] | predicted, rms [mm] | slope by one "
        "| slope by both | correlation |\n|---|---|---|---|---|---|---|"
    )
    grid = np.floor(before.points[fine] / _CELL_M).astype(np.int64)
    _, cell, n = np.unique(grid, axis=0, return_inverse=True, return_counts=True)
    full = n >= _FEWEST
    mean = [(np.bincount(cell, one) / n)[full] for one in (t, p, q)]
    parts = {
        "edges": (t, p, q),
        "edges of C1": tuple(x[before.camera[fine] == 0] for x in (t, p, q)),
        "edges of C2": tuple(x[before.camera[fine] == 1] for x in (t, p, q)),
        "cells of 10 mm": tuple(mean),
    }
    bits = scanner.projectors[0].pattern.flipping_bit[before.ring[fine]]
    for bit in range(_BITS):
        parts[f"edges of bit {bit}"] = tuple(x[bits == bit] for x in (t, p, q))
    for name, (a, b, c) in parts.items():
        rms = [1e3 * np.sqrt(np.mean(x**2)) for x in (a, 0.5 * (b + c))]
        print(
            f"| {name} | {len(a)} | {rms[0]:.4f} | {rms[1]:.4f} | {slopes(a, b, c)} |"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 48)
