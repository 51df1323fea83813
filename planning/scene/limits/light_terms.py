"""How bright lit and dark surface come out, and what noise that leaves to a code."""

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
        white: Of lit surface where the surface is brightest.
        contrast: Lit less dark where it is darkest.
        noise: Of a pixel half lit there, as a share of the contrast.
    """

    white: _Array
    contrast: _Array
    noise: _Array


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
    light: LightBudget, lit: _Array, dark: _Array, axis_cos: _Array
) -> GreyLevels:
    """Return how bright samples come out: a lens is darker off its axis by cos^4.

    Args:
        light: Of devices.
        lit: Electrons of lit surface of albedo 1 on the axis, shape (n,).
        dark: Likewise of dark surface.
        axis_cos: Cosine of the angle off the camera's axis, shape (n,).
    """
    low, high = light.albedo
    off_axis = axis_cos**4
    white, signal = high * off_axis * lit, low * off_axis * (lit - dark)
    middle = 0.5 * low * off_axis * (lit + dark)
    noise = np.sqrt(middle + light.own_variance) / np.maximum(signal, 1e-9)
    grey = light.grey_per_electron
    return GreyLevels(white * grey, signal * grey, noise)


def edge_noise_px(grey: GreyLevels, width_px: _Array) -> _Array:
    """Return the noise of an edge where frame and inverse cross [px], (n,).

    The edge's slope is the contrast S over sqrt(2 pi) w; they cross in its middle, each
    with the noise s_M of a pixel there, and their difference is twice as steep. It is
    found between two pixels, whose noise averages to 2/3::

        s_px = sqrt(2 pi / 3) s_M w / S

    Args:
        grey: Of the samples.
        width_px: w, standard deviation of the edge's blur in the image [px], (n,).
    """
    return np.sqrt(_BETWEEN * np.pi) * grey.noise * width_px


def phase_noise(grey: GreyLevels, shifts: int, modulation: _Array) -> _Array:
    """Return the noise of the phase of shifted sinusoids [rad], (n,).

    Of N images with the noise s_M a pixel, the amplitude is half the contrast S, of
    which blur leaves a share M (`modulation`)::

        s_phi = sqrt(2 / N) s_M / (M S / 2)
    """
    return np.sqrt(8.0 / shifts) * grey.noise / modulation
