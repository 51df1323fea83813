"""Where the light of a projector's rings meets the surface, ray by ray."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.devices import PinholeModel
from geometry.mesh.mesh import TriangleMesh
from planning.model.plan import RigPlan
from planning.model.surface import Surface
from planning.verify.audit.audit_samples import AuditSamples
from planning.verify.audit.predicates.audit_optics import (
    in_frame,
    in_image,
    in_world,
    pixels_of,
    ring_coordinate,
)
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import LIT, AuditProjector, light_steps
from planning.verify.audit.predicates.recompute import audit_projectors


@dataclass(frozen=True, eq=False)
class Strikes:
    """What rays of a projector meet first.

    Attributes:
        drawn: Whether each ray leaves the panel or beam, shape (n,).
        rays: Index of each ray that leaves it and meets the object, shape (k,).
        samples: Where, shape (k,) each; their weights are 1.
        height: z of these points in the ring frame [m], shape (k,).
        lit: Whether every limit of *lit* holds there, shape (k,).
    """

    drawn: NDArray[np.bool_]
    rays: NDArray[np.int64]
    samples: AuditSamples
    height: NDArray[np.float64]
    lit: NDArray[np.bool_]


class RingLight:
    """Casts the light of a plan's projectors along their rings.

    Args:
        plan: The plan.
        shadow: Its surface, as rays meet it.
    """

    def __init__(self, plan: RigPlan, shadow: Shadow) -> None:
        self.lamps = audit_projectors(plan)
        self._surface: Surface = plan.surface
        self._within = plan.surface.target_faces(plan.requirements.target)
        self._limits = plan.requirements.projector
        self.shadow = shadow

    @property
    def mesh(self) -> TriangleMesh:
        """What the light falls on."""
        return self._surface.mesh

    def strike(
        self,
        lamp: AuditProjector,
        coordinates: NDArray[np.float64],
        azimuths: NDArray[np.float64],
    ) -> Strikes:
        """Cast one ray for each ring coordinate and azimuth.

        Args:
            lamp: The projector.
            coordinates: Tangent R, or radius in [m] in parallel light, shape (n,).
            azimuths: About the ring axis, from its x towards y [rad], shape (n,).
        """
        origins, along = _rays(lamp, coordinates, azimuths)
        drawn = _drawn(lamp, origins, along)
        rays = np.flatnonzero(drawn)
        faces, distance = self.shadow.caster.first_hits(origins[rays], along[rays])
        met = faces >= 0
        rays, faces = rays[met], faces[met]
        points = origins[rays] + distance[met][:, None] * along[rays]
        samples = self._samples(points, faces)
        lit = light_steps(lamp, samples, self._limits, self.shadow) == LIT
        height = in_frame(lamp.world_from_ring, points)[:, 2]
        return Strikes(drawn, rays, samples, height, lit)

    def lit_beside(
        self,
        lamp: AuditProjector,
        points: NDArray[np.float64],
        faces: NDArray[np.int64],
    ) -> NDArray[np.bool_]:
        """Return whether a projector lights points (n, 3) of given faces, (n,)."""
        samples = self._samples(points, faces)
        return light_steps(lamp, samples, self._limits, self.shadow) == LIT

    def _samples(
        self, points: NDArray[np.float64], faces: NDArray[np.int64]
    ) -> AuditSamples:
        surface = self._surface
        return AuditSamples(
            points,
            surface.mesh.face_normals[faces],
            faces,
            np.asarray(surface.steep[faces], dtype=np.float64),
            np.asarray(surface.region[faces], dtype=np.int64),
            self._within[faces],
            np.ones(len(faces)),
        )


def gap_about(
    radii: NDArray[np.float64], coordinates: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return radii[k] - radii[k-1], k >= 1 the first with radii[k] >= c, shape (n,)."""
    upper = np.searchsorted(radii, coordinates, side="left")
    upper = np.clip(upper, 1, len(radii) - 1)
    return radii[upper] - radii[upper - 1]


def ring_spacing(
    lamp: AuditProjector, points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the distance along m of the rings about each point, shape (n,) [m].

    Both kinds of light: the gap in the ring coordinate c, divided by |grad c|, which is
    1 for cylinders and sqrt(1 + R^2) / z for cones.
    """
    ring = in_frame(lamp.world_from_ring, points)
    coordinate = ring_coordinate(ring, lamp.diverging)
    gap = gap_about(lamp.radii, coordinate)
    if not lamp.diverging:
        return gap
    return gap * ring[:, 2] / np.hypot(1.0, coordinate)


def _rays(
    lamp: AuditProjector,
    coordinates: NDArray[np.float64],
    azimuths: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Origins in [m] and unit directions, (n, 3) each."""
    frame = lamp.world_from_ring
    spokes = coordinates[:, None] * np.column_stack(
        [np.cos(azimuths), np.sin(azimuths), np.zeros(len(azimuths))]
    )
    if lamp.diverging:
        along = in_world(frame, spokes + [0.0, 0.0, 1.0])
        along /= np.linalg.norm(along, axis=1)[:, None]
        return np.tile(frame[:3, 3], (len(along), 1)), along
    origins = frame[:3, 3] + in_world(frame, spokes)
    return origins, np.tile(frame[:3, 2], (len(origins), 1))


def _drawn(
    lamp: AuditProjector, origins: NDArray[np.float64], along: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Whether rays leave the panel (diverging) or the beam (parallel), shape (n,)."""
    device = lamp.device
    if isinstance(device, PinholeModel):
        local = along @ lamp.world_from_device[:3, :3]
        ahead = np.flatnonzero(local[:, 2] > 0.0)
        drawn = np.zeros(len(along), dtype=bool)
        drawn[ahead] = in_image(device.resolution, pixels_of(device, local[ahead]))
        return drawn
    local = in_frame(lamp.world_from_device, origins)
    half = 0.5 * device.pixel_pitch_m * np.array(device.resolution)
    drawn = np.all(np.abs(local[:, :2]) <= half, axis=1)
    if device.beam_radius is not None:
        drawn &= np.hypot(local[:, 0], local[:, 1]) <= device.beam_radius
    return drawn
