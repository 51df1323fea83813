"""A projector's light on what a camera sees: how bright, whence, how blurred."""

from dataclasses import dataclass, replace

import numpy as np

from geometry.arrays import lengths, rows_of
from geometry.rays.rays import CHUNK, RayCaster, equal_parts
from planning.verify.reconstruction.arrays import Array, Columns, Grey, Indices
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.patterns.defocus import Defocus
from planning.verify.reconstruction.patterns.ring_patterns import RingsForCamera

from .lamp import Lamp
from .view import RenderedView

# Standard deviation of the unit square that a pixel gathers light over.
_PIXEL_SPREAD = 1.0 / np.sqrt(12.0)
# Where a camera looks along the surface no edge is found; what a pixel gathers there is
# cut off so wide [px of the projector].
_MOST_GATHERED_PX = 3.0
# Shadow rays stop this share of their length before the point they ask about.
SHADOW_SLACK = 2e-5


@dataclass(frozen=True, eq=False)
class RenderedLight(Columns):
    """A projector's light on the samples of a view that it reaches, shape (n,) each.

    `white` is the irradiance under a white panel times the albedo; `pixels` where on
    the panel the light is from, and `spread` how widely it is blurred there, (n, 2);
    `depth` z before the projector [m].
    """

    samples: Indices
    white: Grey
    pixels: Array
    spread: Array
    depth: Array


@dataclass(frozen=True, eq=False)
class Shown:
    """A projector that shows its patterns.

    Attributes:
        projector: As it really stands.
        design: As the patterns were drawn for it.
        patterns: What is drawn.
        caster: Of the mesh that really stands there.
        defocus: Of the projector; None: equally sharp everywhere.
        obstacles: What stands before the mesh; None: nothing.
        lamp: How bright it is; None: as bright as the camera likes.
    """

    projector: ProjectorCalibration
    design: ProjectorCalibration
    patterns: RingsForCamera
    caster: RayCaster
    defocus: Defocus | None = None
    obstacles: RayCaster | None = None
    lamp: Lamp | None = None

    def light(self, seen: RenderedView, in_focus_m: float) -> RenderedLight:
        """Return its light on a view's samples, edges in focus blurred by so much."""
        # In parts, so that what is between stays in the cache.
        parts = equal_parts(len(seen.points), CHUNK)
        cosines = [
            self.projector.incidence_cosine(seen.points[some], seen.normals[some])
            for some in parts
        ]
        samples = np.flatnonzero(np.concatenate(cosines) > 0.0)
        parts = equal_parts(len(samples), CHUNK) or [slice(0)]
        light = RenderedLight.join(
            [self._light_on(seen, samples[some], in_focus_m) for some in parts]
        )
        if not len(light):
            return light
        falloff = self.projector.light.falloff(light.depth)
        return replace(light, white=(light.white * falloff).astype(np.float32))

    def _light_on(
        self, seen: RenderedView, samples: Indices, in_focus_m: float
    ) -> RenderedLight:
        """Light on those of some samples that it reaches, before falloff."""
        law = self.projector.light
        lit, cosine, pixels, depth = self._reached(seen, samples)
        # A pixel of the camera gathers light from where it falls on the surface.
        rays, normals = rows_of(seen.rays, lit), rows_of(seen.normals, lit)
        slopes = law.gradients(self.projector.panel_coordinates(pixels), depth)
        turned = slopes.reshape(-1, 3) @ self.projector.world_from_device[:3, :3].T
        slopes = turned.reshape(slopes.shape)
        slant = np.einsum("ikj,ij->ik", slopes, rays)
        slant /= np.einsum("ij,ij->i", normals, rays)[:, None]
        slopes -= slant[:, :, None] * normals[:, None]
        cell = _PIXEL_SPREAD / seen.fold * seen.distances[lit] / seen.camera.focal_px
        scale = np.diag(self.projector.matrix)[:2]
        gathered = cell[:, None] * lengths(slopes) * scale
        square = in_focus_m**2
        if self.defocus is not None:
            square = square + self.defocus.blur_m(depth) ** 2
        blur = (np.sqrt(square) * law.shrink(depth))[:, None] * scale
        return RenderedLight(
            lit,
            (seen.albedo[lit] * cosine).astype(np.float32),
            pixels,
            np.hypot(blur, np.minimum(gathered, _MOST_GATHERED_PX)),
            depth,
        )

    def _reached(
        self, seen: RenderedView, samples: Indices
    ) -> tuple[Indices, Array, Array, Array]:
        """Samples that are lit, their cos(incidence), pixels and depths."""
        projector = self.projector
        pixels, depth = projector.panel(rows_of(seen.points, samples))
        drawn = np.flatnonzero(projector.in_panel(pixels))
        able, pixels, depth = samples[drawn], rows_of(pixels, drawn), depth[drawn]
        pose, points = projector.world_from_device, rows_of(seen.points, able)
        starts, beams, reach = projector.light.aim(pose, points, depth)
        ray = starts, beams, reach * (1.0 - SHADOW_SLACK)
        clear = ~self.caster.occluded(*ray)
        if self.obstacles is not None:
            clear &= ~self.obstacles.occluded(*ray)
        lit = np.flatnonzero(clear)
        cosine = -np.einsum("ij,ij->i", beams, rows_of(seen.normals, able))
        if self.lamp is not None:
            # Even on a plane across the axis: across its rays light is denser.
            cosine /= beams @ projector.axis
            cosine /= 1.0 + self.lamp.leak
        return able[lit], cosine[lit], rows_of(pixels, lit), depth[lit]
