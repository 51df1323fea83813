"""Bodies and obstacles that really stand there, as a mesh that rays are cast against.

They are dark: light that meets one is lost, and a camera that looks at one sees
nothing.
"""

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.rays import RayCaster
from planning.verify.reconstruction.arrays import Array
from planning.verify.reconstruction.calibration import DeviceCalibration
from planning.verify.reconstruction.scanner import Scanner

# Six quads of a box whose corner i has the signs of the bits of i.
_QUADS = np.array(
    [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
)


def obstacles_of(scanner: Scanner, name: str) -> RayCaster | None:
    """Return the bodies of all devices but one, and obstacles; None of nothing.

    They are in the way of the light or view of the device of that name, and stand at
    its station where they stand at one.
    """
    every = (*scanner.projectors, *scanner.cameras)
    here = next((device.station for device in every if device.id == name), "")
    corners = [
        _corners(device)
        for device in every
        if device.id != name and device.body and device.station in ("", here)
    ]
    box = np.concatenate([_QUADS[:, [0, 1, 2]], _QUADS[:, [0, 2, 3]]])
    parts = [TriangleMesh(of_body, box) for of_body in corners]
    parts += [o.mesh for o in scanner.obstacles if o.station in ("", here)]
    return RayCaster(TriangleMesh.joined(parts), threads=1) if parts else None


def _corners(device: DeviceCalibration) -> Array:
    """Corners of a device's body in the world, shape (8, 3); it has one."""
    assert device.body is not None
    signs = np.array([[2 * (i >> k & 1) - 1 for k in range(3)] for i in range(8)])
    local = np.array(device.body.centre_m) + signs * np.array(device.body.half_m)
    pose = device.world_from_device
    return local @ pose[:3, :3].T + pose[:3, 3]
