"""Places of the object that are easy to find again in an image of a device."""

import numpy as np

from geometry.arrays import Array, Ints, Mask
from geometry.curvature.curvature import principal_curvatures
from geometry.mesh.mesh import TriangleMesh
from geometry.poses import transform
from geometry.rays.rays import RayCaster
from planning.handover.export.exported_rig import ExportedDevice, ExportedRig

# Least cosine between the normal of a landmark's best face and the way to the device.
_LEAST_FACING = 0.35
# They stay so far inside the image, as a share of its sides.
_BORDER = 0.04
# Of so many of the most curved vertices three are taken that lie far apart.
_MOST_CURVED = 300
# Rays end so far before a vertex, in radii of the object.
_SHORT = 1e-3


class Landmarks:
    """Vertices of high curvedness, and which of them devices see."""

    def __init__(self, rig: ExportedRig) -> None:
        mesh = rig.mesh
        self.vertices = mesh.vertices
        self._curvedness = np.nan_to_num(principal_curvatures(mesh).curvedness)
        self._mesh, self._rig = mesh, rig
        self._casters: dict[str, RayCaster] = {}
        self._short = _SHORT * mesh.radius

    def seen_by(self, device: ExportedDevice) -> Ints:
        """Return up to three landmarks of a device: indices of vertices, far apart."""
        seen = np.flatnonzero(self._visible(device))
        # Equal ones (a sphere's) in the order of the mesh, whatever the machine rounds.
        steps = np.round(self._curvedness[seen], 6)
        best = seen[np.argsort(-steps, kind="stable")[:_MOST_CURVED]]
        if len(best) < 3:
            return best
        pixels = device.project(self.vertices[best])
        apart = np.linalg.norm(pixels[:, None] - pixels, axis=2)
        one, two = np.unravel_index(int(np.argmax(apart)), apart.shape)
        ways, base = pixels - pixels[one], pixels[two] - pixels[one]
        area = np.abs(ways[:, 0] * base[1] - ways[:, 1] * base[0])
        return best[[int(one), int(two), int(np.argmax(area))]]

    def _visible(self, device: ExportedDevice) -> Mask:
        pose = device.world_from_device
        local = transform(device.device_from_world, self.vertices)
        starts = transform(pose, device.model.ray_starts(local))
        ways = self.vertices - starts
        far = np.linalg.norm(ways, axis=1)
        along = ways / np.maximum(far, 1e-12)[:, None]
        pixels = device.project(self.vertices)
        size = np.array(device.model.resolution)
        spare = _BORDER * size
        inside = (pixels > spare - 0.5) & (pixels < size - 0.5 - spare)
        seen = inside.all(axis=1) & (local[:, 2] > 0.0)
        seen &= device.model.in_field(local)
        seen &= self._facing(device) > _LEAST_FACING
        rows = np.flatnonzero(seen)
        reach = np.maximum(far[rows] - self._short, 0.0)
        caster = self._among(device.planned.station)
        seen[rows] = ~caster.occluded(starts[rows], along[rows], reach)
        return seen

    def _among(self, station: str) -> RayCaster:
        """The object among what stands there when devices of a station measure."""
        if station not in self._casters:
            solids = [self._mesh, *self._rig.standing_at(station)]
            self._casters[station] = RayCaster(TriangleMesh.joined(solids), threads=1)
        return self._casters[station]

    def _facing(self, device: ExportedDevice) -> Array:
        """Return how squarely the best face of each vertex is met, a cosine, (n_v,)."""
        mesh, pose = self._mesh, device.world_from_device
        local = transform(device.device_from_world, mesh.face_centroids)
        starts = transform(pose, device.model.ray_starts(local))
        ways = starts - mesh.face_centroids
        far = np.maximum(np.linalg.norm(ways, axis=1), 1e-12)
        cosines = np.einsum("ij,ij->i", ways, mesh.face_normals) / far
        best = np.full(len(mesh.vertices), -1.0)
        np.maximum.at(best, mesh.faces.ravel(), np.repeat(cosines, 3))
        return best
