"""How far ring edges lie off where they should be, however well they are found."""

import numpy as np
from numpy.typing import NDArray

from planning.model.devices.planned import EDGE_VARIANCE, edge_linearity_px
from planning.model.light.drawn_edges import DrawnEdges

_Array = NDArray[np.float64]


def edge_linearity_m(
    drawn: DrawnEdges, depths: _Array, pixel_m: _Array, image_px_m: _Array
) -> _Array:
    """Return how far drawn edges lie off along m, rms in [m], shape (n,).

    Of a panel's squares p wide at the object what the blur of light and image leaves,
    which is b pixels wide: `edge_linearity_px`::

        p linearity(b),   b = sqrt(light^2 + (camera_px k)^2) / p

    Args:
        drawn: What blurs them.
        depths: z before the projector [m], shape (n,).
        pixel_m: p, shape (n,).
        image_px_m: k, what a pixel of the image is along m [m], shape (n,).
    """
    blur = blur_px(drawn, depths, pixel_m, image_px_m)
    return pixel_m * edge_linearity_px(blur)


def blur_px(
    drawn: DrawnEdges, depths: _Array, pixel_m: _Array, image_px_m: _Array
) -> _Array:
    """Return b, the blur of light and image in pixels of the panel, (n,)."""
    blur_m = np.hypot(drawn.light_m(depths), drawn.camera_px * image_px_m)
    return blur_m / pixel_m


def edge_width_px(
    drawn: DrawnEdges, depths: _Array, pixel_m: _Array, image_px_m: _Array
) -> _Array:
    """Return the blur of drawn edges in the image, a standard deviation [px], (n,).

    Blur of the light, and the ramp that an edge is drawn as, in pixels of the image;
    with lens and pixels of the camera. Arguments are those of `edge_linearity_m`.
    """
    square = drawn.light_m(depths) ** 2 + EDGE_VARIANCE * pixel_m**2
    return np.sqrt(drawn.camera_px**2 + square / image_px_m**2)
