"""A rig that measures once more, with rings between those of before."""

from dataclasses import replace

import numpy as np

from planning.verify.reconstruction.arrays import Array, Indices
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.cloud import Cloud
from planning.verify.reconstruction.scanner import Scanner

from .second_radii import Gaps, MeasuredRings, nearest_rings, second_radii

# Rings of one sequence, in a camera's image and in the projector's.
_CAMERA_PX, _PROJECTOR_PX = 6.0, 3.0
# Of the points of a ring so many may lie nearer to the next one: at steps they do.
_NEAR = 0.05
_LEAST_NOISE_M = 1e-6


def second_sequence(scanner: Scanner, cloud: Cloud) -> Scanner:
    """Return the rig with as many rings in other places, as its first points ask.

    Rings keep 6 px, or what the first ones keep, between each other in every image, and
    3 px in the projector's.

    Args:
        scanner: With the first sequence's rings.
        cloud: All points that these measured.
    """
    return _with_radii(
        scanner,
        [
            second_radii(_gaps(scanner, p, cloud.take(cloud.projector == p)))
            for p in range(len(scanner.projectors))
        ],
    )


def both_sequences(
    first: Scanner, second: Scanner
) -> tuple[Scanner, tuple[tuple[Indices, ...], tuple[Indices, ...]]]:
    """Return the rig with the rings of both, and which of these each sequence's are.

    For the first sequence and the second: of each projector indices into the radii of
    both, shape (n,).
    """
    pairs = [
        (a.pattern.radii, b.pattern.radii)
        for a, b in zip(first.projectors, second.projectors, strict=True)
    ]
    every = [np.unique(np.concatenate(radii)) for radii in pairs]
    before, after = (
        tuple(
            np.searchsorted(union, own[turn])
            for union, own in zip(every, pairs, strict=True)
        )
        for turn in (0, 1)
    )
    return _with_radii(first, every), (before, after)


def numbered(cloud: Cloud, places: tuple[Indices, ...]) -> Cloud:
    """Return a cloud whose rings are numbered as those of both sequences."""
    ring = cloud.ring.copy()
    for p, of_both in enumerate(places):
        own = cloud.projector == p
        ring[own] = of_both[cloud.ring[own]]
    return replace(cloud, ring=ring)


def _with_radii(scanner: Scanner, radii: list[Array]) -> Scanner:
    projectors = tuple(
        replace(one, pattern=replace(one.pattern, radii=own))
        for one, own in zip(scanner.projectors, radii, strict=True)
    )
    return replace(scanner, projectors=projectors)


def _gaps(scanner: Scanner, p: int, cloud: Cloud) -> Gaps:
    """Return what one projector's points say of the gaps between its rings."""
    projector, radii = scanner.projectors[p], scanner.projectors[p].pattern.radii
    noise = cloud.sigma(cloud.beams)
    measured = MeasuredRings.of(
        projector.pattern,
        projector.to_ring(cloud.points),
        cloud.ring,
        max(float(np.median(noise)) if len(cloud) else 0.0, _LEAST_NOISE_M),
    )
    bend, seen = measured.bends(scanner.limits.max_lit)
    return Gaps(radii, bend, seen, _finest(scanner, projector, cloud))


def _finest(scanner: Scanner, projector: ProjectorCalibration, cloud: Cloud) -> Array:
    """Return the least distance of rings in each gap, in the unit of radii, (n,).

    The distance in an image goes with that of the rings. Where no two rings are seen
    the gap's own stands in, about the centre that of the first gap beyond.
    """
    radii = projector.pattern.radii
    lengths = np.diff(radii, prepend=0.0)
    apart = np.full(len(radii), np.inf)
    for c in range(len(scanner.cameras)):
        own = cloud.take(cloud.camera == c)
        near = nearest_rings(own.pixels, own.ring, len(radii), share=_NEAR)
        apart = np.fmin(apart, near)
    least = min(_CAMERA_PX, float(apart.min()))
    with np.errstate(divide="ignore"):
        finest = np.where(np.isfinite(apart), lengths * least / apart, lengths)
    finest[0] = min(finest[1], lengths[0])
    focal = float(np.diag(projector.matrix)[:2].min())
    drawn = _PROJECTOR_PX / focal
    if projector.light.name == "diverging":
        drawn = drawn * (1.0 + radii**2)
    return np.maximum(finest, drawn)
