"""Rings of cameras about a target, from the closed forms on its section.

About an axis through the centre of the workspace, the target's section is taken for a
disc of radius rho, that of its farthest sample from the axis. Cameras on a ring of
radius S that face the centre then cover eta to either side of themselves, so
floor(pi / eta) + 1 of them stand at a spacing of at most 2 eta (`covered_azimuth`,
`docs/method/baselines.md`).
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from geometry.devices import PinholeModel
from geometry.poses import fibonacci_cap
from planning.cameras.baselines.coverage_triangle import covered_azimuth
from planning.model.requirements import Workspace

_Array = NDArray[np.float64]

_AXES = 16
# More cameras than the section asks for, at a closer spacing: ends and hollows are
# steeper than the disc.
_MORE = 2
_PHASES = 2
# Rings of more cameras than this promise nothing: the field is too narrow.
_MOST = 36


def camera_rings(
    points: _Array,
    workspace: Workspace,
    device: PinholeModel,
    ring_radius: float,
    max_incidence: float,
) -> Iterator[_Array]:
    """Yield directions from the centre to cameras on rings about several axes, (n, 3).

    Each axis has rings of n_min cameras and of some more, turned.

    Args:
        points: Samples of the target in [m], shape (n, 3).
        workspace: Its centre, and the frame from which axes and azimuths count.
        device: Optics; its narrower field counts.
        ring_radius: S, of the camera centres, in [m].
        max_incidence: theta in [rad].
    """
    offsets = points - np.array(workspace.centre)
    # The image's shorter side, as if it were 1 m away.
    alpha = float(np.arctan(device.half_rectangle(1.0).min()))
    for axis, e1 in _axes(workspace):
        along = offsets @ axis
        rho = float(np.sqrt(np.max((offsets**2).sum(axis=1) - along**2)))
        if not 0.0 < rho < ring_radius:
            continue
        eta = covered_azimuth(rho, ring_radius, max_incidence, alpha)
        # Parts that only touch don't cover: pi/eta = 4 takes five, however rounded.
        fewest = int(np.floor(np.pi / eta + 1e-9)) + 1
        e2 = np.cross(axis, e1)
        for n in range(fewest, min(fewest + _MORE, _MOST) + 1):
            spacing = 2.0 * np.pi / n
            for phase in range(_PHASES):
                azimuth = spacing * (np.arange(n) + phase / _PHASES)
                yield np.cos(azimuth)[:, None] * e1 + np.sin(azimuth)[:, None] * e2


def _axes(workspace: Workspace) -> Iterator[tuple[_Array, _Array]]:
    """Axes and unit vectors across them: the vertical, then some over half of all.

    Azimuth 0 lies in the plane of the ring's axis and the workspace's: where that is a
    cone, one camera stands as near to the middle of it as the ring does.
    """
    towards = np.array(workspace.axis)
    start = None if workspace.bearing is None else np.array(workspace.bearing)
    axes = fibonacci_cap(_AXES, towards, np.pi / 2, start=start)
    for axis in (np.array(workspace.up), *axes):
        across = towards - (towards @ axis) * axis
        if not np.linalg.norm(across) > 1e-6:
            spare = np.eye(3)[np.argmin(np.abs(axis))] if start is None else start
            across = spare - (spare @ axis) * axis
        yield axis, across / np.linalg.norm(across)
