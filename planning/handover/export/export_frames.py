"""Other origins and axes than the mesh's, which `plan export --frame` re-expresses in.

A frame F is given by its origin o and its turn in the axes of the mesh::

    frame_from_mesh x = R^T (x - o),   R = B Rz(azimuth) Ry(-tilt) Rx(roll) B^T

where the columns of B are the `horizontal_axes` and up. So azimuth turns the axes about
up, tilt raises the first horizontal one over the horizon, roll turns about it, and with
three zeros the axes stay parallel to the mesh's.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from geometry.arrays import Array
from geometry.poses import horizontal_axes
from planning.model.errors import PlanningError
from planning.model.requirements import Workspace

FLOOR = "floor"
# Beyond any rig [mm].
_LARGEST = 1e9


class FrameError(PlanningError):
    """A frame that isn't one, or that the plan doesn't have."""

    exit_code = 2


@dataclass(frozen=True, eq=False)
class ExportFrame:
    """Where an export's coordinates count from.

    Attributes:
        words: As files and lines name it.
        frame_from_mesh: Motion from the mesh's axes, shape (4, 4) [m].
    """

    words: str
    frame_from_mesh: Array

    @property
    def is_meshs(self) -> bool:
        """Whether coordinates in it are those of the mesh file."""
        return np.array_equal(self.frame_from_mesh, np.eye(4))


def frame_of(text: str | None, workspace: Workspace) -> ExportFrame:
    """Return the frame that a text names.

    Args:
        text: `X,Y,Z` [mm], `X,Y,Z,AZIMUTH,TILT,ROLL` [mm, deg], `floor`, or the name of
            a mounting plane; None: the mesh's own.
        workspace: Of the plan.

    Raises:
        FrameError: If it is none of these, or the plan has no such plane.
    """
    if text is None:
        return ExportFrame("axes and origin of the mesh file", np.eye(4))
    planes = {box.name: box for box in workspace.mounting}
    centre = np.array(workspace.centre)
    if text in planes:
        plane = planes[text]
        turn = np.array(plane.axes).T
        words = f"mounting plane {text!r}: origin its middle, z its normal"
        return ExportFrame(words, _motion(turn, centre + plane.centre_m))
    if text == FLOOR:
        if workspace.floor_m is None:
            raise FrameError("--frame floor: the plan has no floor; give X,Y,Z in mm")
        below = centre + workspace.floor_m * np.array(workspace.up)
        words = "axes of the mesh, origin on the floor under the object's centre"
        return ExportFrame(words, _motion(np.eye(3), below))
    numbers = _numbers(text, list(planes))
    turn = _turn(np.radians(numbers[3:]), np.array(workspace.up))
    return ExportFrame(_words(numbers), _motion(turn, 1e-3 * np.array(numbers[:3])))


def _numbers(text: str, planes: list[str]) -> list[float]:
    try:
        numbers = [float(word) for word in text.split(",")]
    except ValueError:
        numbers = []
    sane = all(math.isfinite(x) and abs(x) <= _LARGEST for x in numbers)
    if len(numbers) not in (3, 6) or not sane:
        named = ", ".join([FLOOR, *map(repr, planes)])
        raise FrameError(
            f"--frame {text} must be X,Y,Z in mm, X,Y,Z,AZIMUTH,TILT,ROLL in mm and "
            f"degrees, or one of {named}"
        )
    return numbers + [0.0] * (6 - len(numbers))


def _words(numbers: list[float]) -> str:
    place = ", ".join(f"{x:g}" for x in numbers[:3])
    if not any(numbers[3:]):
        return f"axes of the mesh, origin at its {place} mm"
    azimuth, tilt, roll = numbers[3:]
    return (
        f"origin at the mesh's {place} mm, axes turned by azimuth {azimuth:g}, tilt "
        f"{tilt:g}, roll {roll:g} degrees"
    )


def _turn(angles: Array, up: Array) -> Array:
    azimuth, tilt, roll = angles
    along = np.column_stack([*horizontal_axes(up), up])
    turn = Rotation.from_euler("ZYX", [azimuth, -tilt, roll]).as_matrix()
    return along @ turn @ along.T


def _motion(turn: Array, origin: Array) -> Array:
    motion = np.eye(4)
    motion[:3, :3] = turn.T
    motion[:3, 3] = -turn.T @ origin
    return motion
