"""Where else a device might stand or look: starts for fits that are far off."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

# Tangents at the object's distance by which a device may have been turned aside [m].
_ASIDE_M = np.linspace(-0.06, 0.06, 7)
_PLACES = 120
_ROLLS = 6


def turns_aside(pose: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return turns about a device's x and y axes, as lengths at the object [m].

    Args:
        pose: ``world_from_device``, shape (4, 4).
    """
    x, y = pose[:3, 0], pose[:3, 1]
    return [a * x + b * y for a in _ASIDE_M for b in _ASIDE_M]


def far_poses(
    pose: NDArray[np.float64], middle: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Return poses all about the object at the same distance, in several rolls.

    The directions are a Fibonacci lattice on the sphere; the aim at the object stays.

    Args:
        pose: ``world_from_device``, shape (4, 4).
        middle: Of the object in the world [m], shape (3,).
    """
    k = np.arange(_PLACES) + 0.5
    z = 1.0 - 2.0 * k / _PLACES
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - z * z)
    sphere = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
    away = pose[:3, 3] - middle
    reach = float(np.linalg.norm(away))
    poses: list[NDArray[np.float64]] = []
    for towards in sphere:
        about = _shortest_turn(away / reach, towards)
        for roll in np.arange(_ROLLS) * (2.0 * np.pi / _ROLLS):
            turned = Rotation.from_rotvec(roll * towards).as_matrix() @ about
            new = np.eye(4)
            new[:3, :3] = turned @ pose[:3, :3]
            new[:3, 3] = middle + turned @ away
            poses.append(new)
    return poses


def _shortest_turn(
    one: NDArray[np.float64], other: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the least rotation that takes one unit vector to another, (3, 3)."""
    axis = np.cross(one, other)
    sine, cosine = float(np.linalg.norm(axis)), float(one @ other)
    if sine < 1e-9:
        axis = np.cross(one, np.eye(3)[np.argmin(np.abs(one))])
        sine = float(np.linalg.norm(axis))
        return Rotation.from_rotvec(
            axis / sine * (0.0 if cosine > 0.0 else np.pi)
        ).as_matrix()
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, cosine)).as_matrix()
