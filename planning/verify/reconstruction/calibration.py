"""What a scanner knows of its devices: optics and poses, and nothing of the object.

The projection here is written apart from `geometry.devices`, which the planner uses, so
that a mistake in one shows against the other. Pixels follow OpenCV: the centre of the
top-left pixel is (0, 0).
"""

from dataclasses import dataclass, field

import numpy as np

from geometry.devices import ParallelModel
from planning.model.devices.bodies import Body
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.verify.reconstruction.patterns.response import Response
from planning.verify.reconstruction.patterns.ring_patterns import (
    DrawnRings,
    RingsForCamera,
)

from .arrays import Array, Mask
from .light_laws import LIGHTS, LightLaw
from .patterns.defocus import Defocus
from .patterns.dense_patterns import DensePattern
from .patterns.lens import bent, unbent


@dataclass(frozen=True, eq=False)
class DeviceCalibration:
    """A device: optics and pose.

    Attributes:
        id: Name of the device.
        world_from_device: Pose [m], shape (4, 4).
        matrix: From panel coordinates to pixels, shape (3, 3): K, where panel
            coordinates are (x/z, y/z); for parallel light, where they are (x, y) in
            [m], 1 / pixel pitch on the diagonal.
        resolution: Width and height in [px].
        body: Its housing; None: it takes no room.
        station: Where it stands with those that it measures with; empty: with any.
    """

    id: str
    world_from_device: Array
    matrix: Array
    resolution: tuple[int, int]
    body: Body | None = field(default=None, kw_only=True)
    station: str = field(default="", kw_only=True)

    @property
    def centre(self) -> Array:
        """Optical centre, or centre of the panel, in the world in [m], shape (3,)."""
        return self.world_from_device[:3, 3]

    @property
    def axis(self) -> Array:
        """Direction of the optical axis in the world, shape (3,)."""
        return self.world_from_device[:3, 2]

    def panel_coordinates(self, pixels: Array) -> Array:
        """Return panel coordinates (n, 2) of pixels (n, 2)."""
        # Column by column: rows of two numbers take numpy twice as long.
        flat = np.empty(pixels.shape)
        for k in (0, 1):
            flat[:, k] = (pixels[:, k] - self.matrix[k, 2]) / self.matrix[k, k]
        return flat

    def _local(self, points: Array) -> Array:
        return (points - self.centre) @ self.world_from_device[:3, :3]

    def _pixels(self, panel: Array) -> Array:
        pixels = np.empty(panel.shape)
        for k in (0, 1):
            pixels[:, k] = panel[:, k] * self.matrix[k, k] + self.matrix[k, 2]
        return pixels


@dataclass(frozen=True, eq=False)
class CameraCalibration(DeviceCalibration):
    """A camera: pinhole, Brown-Conrady lens k1, k2, p1, p2, k3, pose.

    Attributes:
        distortion: Of the lens.
        focus: How it is focused; None: nobody says.
    """

    distortion: tuple[float, ...]
    focus: Defocus | None = field(default=None, kw_only=True)

    @property
    def focal_px(self) -> float:
        """Mean of the two focal lengths in [px]."""
        return 0.5 * float(self.matrix[0, 0] + self.matrix[1, 1])

    def project(self, points: Array) -> Array:
        """Return pixels (n, 2) of world points (n, 3); NaN behind the camera."""
        local = self._local(points)
        z = np.where(local[:, 2] > 0.0, local[:, 2], np.nan)
        return self._pixels(bent(local[:, :2] / z[:, None], self.distortion))

    def rays(self, pixels: Array) -> Array:
        """Return unit viewing directions (n, 3) in the world of pixels (n, 2).

        NaN where no point of the scene is imaged: the lens folds there.
        """
        flat = self.panel_coordinates(pixels)
        if any(self.distortion):
            flat = unbent(flat, self.distortion)
        x, y = flat.T
        scale = 1.0 / np.sqrt(x * x + y * y + 1.0)
        local = np.column_stack([x * scale, y * scale, scale])
        return local @ self.world_from_device[:3, :3].T


@dataclass(frozen=True, eq=False)
class ProjectorCalibration(DeviceCalibration):
    """A projector: optics, pose, the frame of its rings and what it draws.

    Attributes:
        world_from_ring: Pose of the ring frame [m], shape (4, 4).
        beam_radius: Radius of a parallel beam about the device's axis [m]; None: none.
        pattern: What it draws.
        response: Light of its grey levels.
        drawn_for: The matrix that its images were drawn for; None: its own. With other
            optics than that a ring isn't a circle any more, but still a conic.
        dense: What it codes its pixels by, `pattern` being without rings; None: rings.
        distortion: Of the lens of a projector that codes its pixels, as of a camera's.
    """

    world_from_ring: Array
    beam_radius: float | None
    pattern: DrawnRings
    response: Response = field(default=Response(), kw_only=True)
    drawn_for: Array | None = field(default=None, kw_only=True)
    dense: DensePattern | None = field(default=None, kw_only=True)
    distortion: tuple[float, ...] = field(default=(0.0,) * 5, kw_only=True)

    @property
    def light(self) -> LightLaw:
        """How its light leaves it."""
        return self.pattern.light

    def pattern_for(self, camera: CameraCalibration) -> RingsForCamera:
        """Return what it draws as a camera's decoder reads it."""
        seen_from = self.to_ring(camera.centre[None])[0]
        return RingsForCamera(self.light, self.pattern.radii, seen_from)

    def aim(self, points: Array) -> tuple[Array, Array, Array]:
        """Return where the light of world points starts, its directions and lengths."""
        depth = (points - self.centre) @ self.axis
        return self.light.aim(self.world_from_device, points, depth)

    def incidence_cosine(self, points: Array, normals: Array) -> Array:
        """Return cosines of the incidence of its light, shadows left aside, (n,).

        Points of the surface [m] and unit normals there have shape (n, 3).
        """
        return -np.einsum("ij,ij->i", self.aim(points)[1], normals)

    @property
    def ring_from_device(self) -> Array:
        """Pose of the device in the ring frame [m], shape (4, 4)."""
        turn = self.world_from_ring[:3, :3].T
        pose = np.eye(4)
        pose[:3, :3] = turn @ self.world_from_device[:3, :3]
        pose[:3, 3] = turn @ (self.centre - self.world_from_ring[:3, 3])
        return pose

    @property
    def drawn_matrix(self) -> Array:
        """From panel coordinates to pixels, as its images were drawn, shape (3, 3)."""
        return self.matrix if self.drawn_for is None else self.drawn_for

    @property
    def ring_axes(self) -> Array:
        """What directions in the world become in the ring frame, d @ axes, (3, 3).

        Not quite a rotation, nor that frame a rigid one, if drawn for other optics.
        """
        turn = self.world_from_ring[:3, :3]
        if self.drawn_for is None:
            return turn
        bent = self._bent()[:3, :3].T
        device = self.world_from_device[:3, :3]
        return device @ bent @ device.T @ turn

    def _bent(self) -> Array:
        """From where light is to where it would be with the optics drawn for, (4, 4).

        In the device's frame; its pixel stays.
        """
        drawn = np.diag(self.drawn_matrix)[:2]
        offset = (self.matrix[:2, 2] - self.drawn_matrix[:2, 2]) / drawn
        bent = np.diag([*np.diag(self.matrix)[:2] / drawn, 1.0, 1.0])
        bent[:2, self.light.offset_column] = offset
        return bent

    def to_ring(self, points: Array) -> Array:
        """Return world points (n, 3) in the ring frame."""
        if self.drawn_for is not None:
            bent = self._bent()
            local = self._local(points) @ bent[:3, :3].T + bent[:3, 3]
            points = local @ self.world_from_device[:3, :3].T + self.centre
        return (points - self.world_from_ring[:3, 3]) @ self.world_from_ring[:3, :3]

    def ring_coordinate(self, points: Array) -> Array:
        """Return |p| of the light at world points (n, 3), shape (n,)."""
        p = self.light.plane(self.to_ring(points))
        return np.hypot(p[:, 0], p[:, 1])

    def ring_plane(self, pixels: Array) -> Array:
        """Return where pixels (n, 2) lie in the plane that rings are drawn in, (n, 2).

        (x/z, y/z) in diverging light, (x, y) in [m] in parallel light.
        """
        drawn = self.drawn_matrix
        flat = (pixels - drawn[:2, 2]) / np.diag(drawn)[:2]
        return self.light.turned(flat, self.ring_from_device)

    def panel(self, points: Array) -> tuple[Array, Array]:
        """Return pixels (n, 2) that light world points (n, 3), and depths z (n,).

        Pixels are NaN behind the device.
        """
        local = self._local(points)
        z = local[:, 2]
        shrink = self.light.shrink(np.where(z > 0.0, z, 1.0))
        flat = local[:, :2] * np.where(z > 0.0, shrink, np.nan)[:, None]
        if any(self.distortion):
            flat = bent(flat, self.distortion)
        return self._pixels(flat), z

    def flattened(self, pixels: Array) -> Array:
        """Return p (n, 2) of the light of pixels (n, 2); NaN: its lens folds there."""
        flat = self.panel_coordinates(pixels)
        return unbent(flat, self.distortion) if any(self.distortion) else flat

    def pixel_m(self, points: Array) -> Array:
        """Return how wide a pixel is at world points (n, 3), across the beam [m]."""
        depth = (points - self.centre) @ self.axis
        scale = float(np.sqrt(self.matrix[0, 0] * self.matrix[1, 1]))
        return 1.0 / (scale * self.light.shrink(depth))

    def in_panel(self, pixels: Array, margin_px: float = 0.0) -> Mask:
        """Return whether pixels (n, 2) are drawn: in the image and in the beam."""
        u, v = pixels.T
        width, height = self.resolution
        edge = 0.5 + margin_px
        inside = (u >= -edge) & (u <= width - 1 + edge)
        inside &= (v >= -edge) & (v <= height - 1 + edge)
        if self.beam_radius is not None:
            flat = self.panel_coordinates(pixels)
            reach = self.beam_radius + margin_px / float(self.matrix[0, 0])
            inside &= np.hypot(flat[:, 0], flat[:, 1]) <= reach
        return inside


@dataclass(frozen=True)
class PairCalibration:
    """One projector and one camera."""

    projector: ProjectorCalibration
    camera: CameraCalibration


def calibrate_camera(camera: PlannedCamera) -> CameraCalibration:
    """Return what a plan says of a camera."""
    device = camera.device
    return CameraCalibration(
        camera.id,
        camera.world_from_device,
        device.camera_matrix,
        device.resolution,
        device.distortion,
        body=camera.body,
        station=camera.station,
    )


def calibrate_projector(projector: PlannedProjector) -> ProjectorCalibration:
    """Return what a plan says of a projector."""
    device = projector.device
    if isinstance(device, ParallelModel):
        beam_radius = device.beam_radius
        width, height = device.resolution
        scale = 1.0 / device.pixel_pitch_m
        matrix = np.diag([scale, scale, 1.0])
        matrix[:2, 2] = 0.5 * (width - 1), 0.5 * (height - 1)
        lens = (0.0,) * 5
    else:
        beam_radius, matrix = None, device.camera_matrix
        lens = device.distortion
    code = projector.code
    return ProjectorCalibration(
        projector.id,
        projector.world_from_device,
        matrix,
        device.resolution,
        projector.world_from_ring,
        beam_radius,
        DrawnRings(LIGHTS[projector.light], projector.ring_radii),
        body=projector.body,
        station=projector.station,
        dense=None if code is None else DensePattern(code, device.resolution),
        distortion=(0.0,) * 5 if code is None else lens,
    )
