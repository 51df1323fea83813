"""Eqs. (3) and (6) of the paper, as it has them.

(3) reads y = M x with M = M_in M_ex, from the image to the object. M is 3 x 4 and takes
the object to the image, x ~ M y; its inverse exists only with the ring's constraint,
which is what triangulation adds. (6) should read Y2 = J y2.
"""

import numpy as np
from numpy.typing import NDArray

from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)


def projection_matrix(camera: CameraCalibration) -> NDArray[np.float64]:
    """Return M = M_in M_ex of a camera without lens distortion, shape (3, 4).

    M_in is K, M_ex = [R | t] takes world to device coordinates, eq. (3).
    """
    turn = camera.world_from_device[:3, :3].T
    extrinsic = np.column_stack([turn, -turn @ camera.centre])
    return camera.matrix @ extrinsic


def projected(
    matrix: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the pixels x ~ M y of points y, (n, 3) to (n, 2)."""
    image = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    return image[:, :2] / image[:, 2:]


def coordinate_transform(
    first: ProjectorCalibration, second: ProjectorCalibration
) -> NDArray[np.float64]:
    """Return J of eq. (6): from the second ring frame to the first, shape (4, 4)."""
    turn = first.world_from_ring[:3, :3].T
    transform = np.eye(4)
    transform[:3, :3] = turn @ second.world_from_ring[:3, :3]
    apart = second.world_from_ring[:3, 3] - first.world_from_ring[:3, 3]
    transform[:3, 3] = turn @ apart
    return transform
