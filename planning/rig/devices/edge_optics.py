"""How wide the edges are that a projector draws, where they lie off, who finds them."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from geometry.devices import DeviceModel, PinholeModel
from planning.model.devices.planned import EDGE_VARIANCE, edge_linearity_px
from planning.model.light.drawn_edges import DrawnEdges

# A decoder asks the pixels beside an edge for a level of 0.18; 1 px off one that is
# blurred by w, as a standard deviation, it is erf(1 / (sqrt(2) w)) [px].
MOST_EDGE_PX = 4.4
# Depths at which edges are looked at.
_DEPTHS = 65


def farthest_off(
    drawn: DrawnEdges, device: DeviceModel, depths_m: tuple[float, float]
) -> tuple[float, float]:
    """Return how far drawn edges lie off at most between two depths, and where.

    By blur of the light alone, rms in pixels of the projector and [m].
    """
    depths = np.linspace(*depths_m, _DEPTHS)
    off = edge_linearity_px(drawn.light_m(depths) / device.pixel_m(depths))
    return float(off.max()), float(depths[off.argmax()])


def finest_view_m(
    drawn: DrawnEdges, projector: DeviceModel, distance_m: float
) -> float:
    """Return the least width of a camera's pixel in which drawn edges are all found.

    At the object [m]. Smaller, and an edge is wider than `MOST_EDGE_PX`.
    """
    light_m = np.hypot(
        drawn.light_m(np.array(distance_m)),
        np.sqrt(EDGE_VARIANCE) * projector.pixel_m(distance_m),
    )
    return float(light_m) / math.sqrt(MOST_EDGE_PX**2 - drawn.camera_px**2)


def edge_notes(
    drawn: DrawnEdges, projector: DeviceModel, camera: PinholeModel, distance_m: float
) -> Iterator[str]:
    """Yield that a camera's pixels are too fine for the edges that it is to find."""
    finest, pixel_m = (
        finest_view_m(drawn, projector, distance_m),
        camera.pixel_m(distance_m),
    )
    if pixel_m < finest:
        yield (
            f"a pixel of the camera is {1e3 * pixel_m:.3f} mm at the standoff, and the "
            f"projector's edges are so wide that from {1e3 * finest:.3f} mm down some "
            f"aren't found, though the plan counts on them: a lens of "
            f"{100.0 * pixel_m / finest:.0f} % of this focal length would do"
        )


def straighter_focus(
    drawn: DrawnEdges,
    device: DeviceModel,
    depths_m: tuple[float, float],
    most_px: float,
) -> DrawnEdges | None:
    """Return the focus whose edges lie no farther off, with the least blur; or None.

    Nearer or farther than the object: in focus the panel's squares show.
    """
    if drawn.focus_m is None:
        return None
    near, far = depths_m
    best, least = None, np.inf
    for focus in np.geomspace(0.5 * near, 2.0 * far, 4 * _DEPTHS).tolist():
        # The pupil is fixed: a lens that is focused elsewhere hardly changes length.
        other = replace(drawn, focus_m=focus)
        widest = other.light_m(np.array(depths_m)).max()
        if widest < least and farthest_off(other, device, depths_m)[0] <= most_px:
            best, least = other, widest
    return best
