"""How bright lit and dark rings come out, and what noise that leaves to edges."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.light.light_budget import LightBudget

_Array = NDArray[np.float64]
# Mean of a^2 + (1 - a)^2: the noise of a place between two pixels.
_BETWEEN = 2.0 / 3.0


@dataclass(frozen=True)
class GreyLevels:
    """Grey levels of 255 of n samples, shape (n,) each.

    Attributes:
        white: Of lit rings where the surface is brightest.
        contrast: Lit less dark where it is darkest.
        noise_px: Noise of an edge there, in the image [px].
    """

    white: _Array
    contrast: _Array
    noise_px: _Array


def electrons(
    light: LightBudget, lux_per_lm: _Array, exposure_s: _Array | float
) -> tuple[_Array, _Array]:
    """Return electrons of lit and dark surface of albedo 1, seen on the axis, (...).

    With E the illuminance of a white image and E_r that of the room::

        k t (E + E_r),   k t (E / contrast + E_r)

    Args:
        light: Of devices and room.
        lux_per_lm: Of a lumen on the surface, its incidence counted [1/m^2], (...).
        exposure_s: t [s].
    """
    per_lux = light.electrons_per_lux_s * exposure_s
    lux = light.lumens * lux_per_lm
    return (
        per_lux * (lux + light.room_lux),
        per_lux * (lux / light.contrast + light.room_lux),
    )


def grey_levels(
    light: LightBudget, lit: _Array, dark: _Array, axis_cos: _Array, width_px: _Array
) -> GreyLevels:
    """Return grey levels, and the noise of an edge where frame and inverse cross.

    A lens is darker off its axis by cos^4. The edge's slope is the contrast S over
    sqrt(2 pi) w; frame and inverse cross in its middle, each with the noise of M
    electrons there, and their difference is twice as steep. It is found between two
    pixels, whose noise averages to 2/3::

        s_px = sqrt(2 pi / 3 (M + s_d^2)) w / S

    Args:
        light: Of devices.
        lit: Electrons of lit surface of albedo 1 on the axis, shape (n,).
        dark: Likewise of dark surface.
        axis_cos: Cosine of the angle off the camera's axis, shape (n,).
        width_px: w, standard deviation of the edge's blur in the image [px], (n,).
    """
    low, high = light.albedo
    off_axis = axis_cos**4
    white, signal = high * off_axis * lit, low * off_axis * (lit - dark)
    middle = 0.5 * low * off_axis * (lit + dark)
    noise = np.sqrt(_BETWEEN * np.pi * (middle + light.own_variance)) * width_px
    grey = light.grey_per_electron
    return GreyLevels(white * grey, signal * grey, noise / np.maximum(signal, 1e-9))
