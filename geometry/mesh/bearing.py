"""A direction across an axis that belongs to an object, not to its coordinates."""

import numpy as np

from geometry.arrays import Array

from .mesh import TriangleMesh

# A harmonic below this share of all area says nothing about the direction.
_CLEAR = 0.01
_HARMONICS = 6


def bearing(mesh: TriangleMesh, axis: Array) -> Array:
    """Return a unit direction across an axis that turns with the mesh about it.

    With rho, theta the polar coordinates of the surface about the axis through the
    ball's centre, and dA its area, the direction's azimuth is arg(c_m) / m for the
    first harmonic that is clear::

        c_m = ∫ rho² exp(i m theta) dA / ∫ rho² dA,   |c_m| > 0.01,  m = 1 ... 6

    Of the m directions that this leaves (a box has two), the one that most of the
    lower harmonics point to. A body of revolution about the axis has none: then a world
    axis decides, and any other would do as well.
    """
    spare: Array = np.eye(3)[np.argmin(np.abs(axis))]
    e1 = np.asarray(np.cross(axis, spare), dtype=np.float64)
    e1 = e1 / np.linalg.norm(e1)
    e2 = np.cross(axis, e1)
    used = mesh.main
    offsets = mesh.face_centroids[used] - mesh.centre
    x, y = offsets @ e1, offsets @ e2
    rho = np.hypot(x, y)
    weight = mesh.face_areas[used] * rho**2
    total = float(weight.sum())
    if not total > 0.0:
        return e1
    theta = np.arctan2(y, x)
    harmonics = [
        complex(weight @ np.cos(m * theta), weight @ np.sin(m * theta)) / total
        for m in range(1, _HARMONICS + 1)
    ]
    azimuth = _azimuth(harmonics)
    return np.cos(azimuth) * e1 + np.sin(azimuth) * e2


def _azimuth(harmonics: list[complex]) -> float:
    for m, clear in enumerate(harmonics, 1):
        if abs(clear) > _CLEAR:
            azimuths = (np.angle(clear) + 2.0 * np.pi * np.arange(m)) / m
            lower = sum(
                (
                    np.real(c * np.exp(-1j * k * azimuths))
                    for k, c in enumerate(harmonics[: m - 1], 1)
                ),
                start=np.zeros(m),
            )
            # Where these tie, as on a box, all serve alike; rounding must not choose.
            ranks = (np.sin(azimuths), np.cos(azimuths), lower)
            return float(azimuths[np.lexsort(np.round(ranks, 6))[-1]])
    return 0.0
