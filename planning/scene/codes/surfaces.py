"""A projector's surfaces of equal code at samples: of rings, or of coded pixels.

A pixel of a ring tells one number, and with it a cone or a cylinder. Of a dense code it
tells two, the pixel (u, v) of the panel, so that the planes of all lines through it are
surfaces of equal code. Of these the one across which a camera's ray runs most tells the
distance along the ray; with d the direction of the light its normal is::

    m = (r - (r.d) d) / |r - (r.d) d|,   |r.m| = sin(triangulation angle)

What is left, the code along the other direction, is a test (the epipolar residual).
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import lengths, rows_of
from geometry.devices import ParallelModel
from geometry.poses import inverse, transform
from planning.model.devices.planned import PlannedProjector
from planning.model.light.dense_code import DenseCode
from planning.scene.samples import SampleArrays

_Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PanelLight(SampleArrays):
    """One projector's light at n samples, whatever its pixels show.

    Attributes:
        depths: z before the projector [m], shape (n,).
        pixel_m: How wide the panel's pixels are there [m], shape (n,).
        lux_per_lm: Illuminance across the rays of a lumen in the image [1/m^2], (n,).
        exposure_s: What a frame is exposed for [s], shape (n,).
    """

    depths: _Array
    pixel_m: _Array
    lux_per_lm: _Array
    exposure_s: _Array


@dataclass(frozen=True, eq=False)
class CodeSurfaces(PanelLight):
    """One projector's surfaces of equal code at n samples.

    Attributes:
        normals: Unit normals m in the world, shape (n, 3).
        spacing: h, distance of neighbouring edges along m [m], inf where there are
            none, shape (n,).
        levers: How far errors of the projector move them, `PanelRays.levers`, (n, 3).
    """

    normals: _Array
    spacing: _Array
    levers: _Array

    def towards(self, rays: _Array) -> "CodeSurfaces":
        """Return the surfaces that rays r (n, 3) measure by: always the same."""
        return self

    def on_average(self) -> "CodeSurfaces":
        """Return them for programs, which propose: as they are."""
        return self


@dataclass(frozen=True, eq=False)
class PanelRays(SampleArrays):
    """How a projector's pixels meet n samples, whatever they show.

    Attributes:
        offsets: P - Q, from the device's origin [m], shape (n, 3).
        per_px: How far a pixel moves the light across itself at P [m], (n, 3, 2).
        off_centre: Pixels from the principal point, or from the axis of parallel light,
            shape (n, 2).
    """

    offsets: _Array
    per_px: _Array
    off_centre: _Array

    @classmethod
    def of(cls, projector: PlannedProjector, points: _Array) -> Self:
        """Return how a projector's pixels meet points (n, 3) of the world."""
        pose, device = projector.world_from_device, projector.device
        offsets, local = points - pose[:3, 3], transform(inverse(pose), points)
        if isinstance(device, ParallelModel):
            across = device.pixel_pitch_m * pose[:3, :2]
            per_px = np.broadcast_to(across, (len(points), 3, 2))
            return cls(offsets, per_px, local[:, :2] / device.pixel_pitch_m)
        turned = pose[:3, :3] @ device.ray_jacobian(local)
        per_px = turned * lengths(offsets)[:, None, None]
        off_centre = device.project(local) - device.camera_matrix[:2, 2]
        return cls(offsets, per_px, off_centre)

    def levers(self, m: _Array) -> _Array:
        """Return how far errors of a projector move its surfaces along m, (n, 3) [m].

        With Q the origin of the device and D the displacement of its light by a pixel:
        of a turn by 1 rad |(P - Q) x m|; of a focal length that is off by the whole,
        |D^T m . (u - u_0)|; of a principal point 1 px off along the line that counts
        most, |D^T m|.
        """
        turned, across = lengths(np.cross(self.offsets, m)), self.across_px(m)
        wider = np.einsum("ij,ij->i", across, self.off_centre)
        return np.column_stack([turned, wider, np.hypot(*across.T)])

    def across_px(self, m: _Array) -> _Array:
        """Return D^T m, how far along m a pixel of either direction moves, (n, 2)."""
        return np.einsum("ijk,ij->ik", self.per_px, m)


@dataclass(frozen=True, eq=False)
class PixelSurfaces(CodeSurfaces):
    """The surfaces through coded pixels by which rays are measured best.

    Attributes:
        light_cos: r.d, cosine of the angle at which ray and light meet, shape (n,).
        code: What tells the pixels.
    """

    light_cos: _Array
    code: DenseCode


@dataclass(frozen=True, eq=False)
class CodedPixels:
    """A projector whose pixels are all coded, at n samples.

    Attributes:
        code: What tells them.
        beams: Unit directions d of the light, shape (n, 3).
        panel: How its pixels meet the samples.
        light: Its light there.
    """

    code: DenseCode
    beams: _Array
    panel: PanelRays
    light: PanelLight

    def take(self, chosen: NDArray[np.int64]) -> "CodedPixels":
        """Return what is known of some of the samples."""
        panel, light = self.panel.take(chosen), self.light.take(chosen)
        return CodedPixels(self.code, rows_of(self.beams, chosen), panel, light)

    def on_average(self) -> CodeSurfaces:
        """Return them for programs, which propose, with the light's directions for m.

        Levers are those of the m that moves as far as all do on average.
        """
        panel, light = self.panel, self.light
        wider = np.einsum("ijk,ik->ij", panel.per_px, panel.off_centre)
        pixel = np.sqrt(0.5 * np.square(panel.per_px).sum(axis=(1, 2)))
        turned = np.abs(np.einsum("ij,ij->i", panel.offsets, self.beams))
        return CodeSurfaces(
            light.depths,
            light.pixel_m,
            light.lux_per_lm,
            light.exposure_s,
            normals=self.beams,
            spacing=np.full(len(pixel), np.inf),
            levers=np.column_stack([turned, lengths(wider), pixel]),
        )

    def towards(self, rays: _Array) -> PixelSurfaces:
        """Return the surfaces that rays r (n, 3) measure by; where r = d, none is."""
        along = np.einsum("ij,ij->i", rays, self.beams)
        across = rays - along[:, None] * self.beams
        m = across / np.maximum(lengths(across), 1e-12)[:, None]
        light, endless = self.light, np.full(len(rays), np.inf)
        return PixelSurfaces(
            light.depths,
            light.pixel_m,
            light.lux_per_lm,
            light.exposure_s,
            normals=m,
            spacing=endless,
            levers=self.panel.levers(m),
            light_cos=along,
            code=self.code,
        )


# What a projector's pattern makes of its light at samples.
Coded = CodeSurfaces | CodedPixels
