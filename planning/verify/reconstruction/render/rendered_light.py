"""A projector's light on what a camera sees: which annulus, how bright, how blurred."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from geometry.rays.rays import CHUNK, RayCaster, equal_parts
from planning.verify.reconstruction.arrays import Array, Columns, Grey, Indices
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.patterns.ring_patterns import RingsForCamera
from planning.verify.reconstruction.scanner import Defocus

from .view import RenderedView

# Standard deviation of the unit square that a pixel gathers light over.
_PIXEL_SPREAD = 1.0 / np.sqrt(12.0)
# Shadow rays stop this share of their length before the point they ask about.
SHADOW_SLACK = 2e-5


@dataclass(frozen=True, eq=False)
class RenderedLight(Columns):
    """A projector's light on the samples of a view that it reaches, shape (n,) each.

    `annulus` is where a sample lies; `inner` and `outer` the shares of blurred light
    from the next annulus inwards and outwards; `root` the share of the root disc's
    outside; `white` the irradiance under the white frame times the albedo; `depth` z
    before the projector [m].
    """

    samples: Indices
    white: Grey
    annulus: Indices
    inner: Grey
    outer: Grey
    root: Grey
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
    """

    projector: ProjectorCalibration
    design: ProjectorCalibration
    patterns: RingsForCamera
    caster: RayCaster
    defocus: Defocus | None = None
    obstacles: RayCaster | None = None

    def light(self, seen: RenderedView, in_focus_m: float) -> RenderedLight:
        """Return its light on a view's samples, edges in focus blurred by so much."""
        cosine = self.projector.incidence_cosine(seen.points, seen.normals)
        samples = np.flatnonzero(cosine > 0.0)
        # In parts, so that what is between stays in the cache.
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
        law, patterns = self.projector.light, self.patterns
        lit, cosine, pixels, depth = self._reached(seen, samples)
        rays, normals = seen.rays[lit], seen.normals[lit]
        plane = self.design.ring_plane(pixels)
        rho = np.hypot(plane[:, 0], plane[:, 1])
        outward = plane / np.maximum(rho, 1e-12)[:, None]
        across = law.ring_normals(outward, rho) @ self.design.world_from_ring[:3, :3].T
        slant = np.einsum("ij,ij->i", across, rays)
        slant /= np.einsum("ij,ij->i", normals, rays)
        stretch = 1.0 - 2.0 * slant * np.einsum("ij,ij->i", across, normals) + slant**2
        cell = _PIXEL_SPREAD / seen.fold
        pixel = cell * seen.distances[lit] / seen.camera.focal_px
        square = in_focus_m**2
        if self.defocus is not None:
            square = square + self.defocus.blur_m(depth) ** 2
        blur = np.sqrt(square + pixel**2 * np.maximum(stretch, 0.0))
        spread = blur / law.across_m(np.ones_like(rho), rho, depth)
        annulus, inner, outer, drawn = patterns.blurred(rho, spread)
        return RenderedLight(
            lit,
            (seen.albedo[lit] * cosine * drawn).astype(np.float32),
            annulus,
            inner.astype(np.float32),
            outer.astype(np.float32),
            ndtr(patterns.root_side(plane) / spread).astype(np.float32),
            depth,
        )

    def _reached(
        self, seen: RenderedView, samples: Indices
    ) -> tuple[Indices, Array, Array, Array]:
        """Samples that are lit, their cos(incidence), pixels and depths."""
        projector = self.projector
        pixels, depth = projector.panel(seen.points[samples])
        drawn = projector.in_panel(pixels)
        able, pixels, depth = samples[drawn], pixels[drawn], depth[drawn]
        pose, points = projector.world_from_device, seen.points[able]
        starts, beams, reach = projector.light.aim(pose, points, depth)
        ray = starts, beams, reach * (1.0 - SHADOW_SLACK)
        lit = ~self.caster.occluded(*ray)
        if self.obstacles is not None:
            lit &= ~self.obstacles.occluded(*ray)
        cosine = -np.einsum("ij,ij->i", beams, seen.normals[able])
        return able[lit], cosine[lit], pixels[lit], depth[lit]
