"""What a pair of projector and camera measures of each sample, and how exactly.

A point lies where its viewing ray meets its ring surface; of coded pixels, the plane of
their light that the ray crosses most squarely. With w = N - m (N.r) / (m.r)
it moves along the normal by w.dX if its ray moves by dX there, and by (m.dY) (N.r) /
(m.r) if the surface moves by dY: each error of a device is one of either.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from geometry.arrays import Array, cross, lengths
from planning.model.light.dense_code import DenseCode
from planning.model.light.drawn_edges import DrawnEdges
from planning.model.light.light_budget import LightBudget
from planning.model.requirements import TriangulationLimits
from planning.verify.audit.audit_samples import AuditSamples

from .audit_devices import AuditCamera, AuditProjector
from .audit_optics import dot, in_frame, lens_shifts, pixel_gradient, towards
from .light_levels import LightLevels

NOISE_TERMS = ("edges", "light", "phase", "rings", "linearity")


@dataclass(frozen=True, eq=False)
class PairGeometry:
    """A pair at n samples, each (n,) or (n, 3).

    Attributes:
        m: Unit normals of the surfaces of equal code.
        w: What an error of a viewing ray moves the point by, along the normal.
        levers: (N.r) / (m.r), what an error of such a surface moves it by.
        gradient: w.dX of a viewing ray in pixels, at unit length [1/px], (n, 2).
        per_px: What an edge that is off by 1 px does along the normal [m/px].
        incidence: -N.L.
        normals: N.
        conditioning: |r.m|.
        pitch: Of neighbouring rings in the image [px]; inf: there are none.
        met: Angle between ray and light [rad].
    """

    projector: AuditProjector
    camera: AuditCamera
    points: Array
    m: Array
    w: Array
    levers: Array
    gradient: Array
    per_px: Array
    incidence: Array
    normals: Array
    conditioning: Array
    pitch: Array
    met: Array

    @classmethod
    def of(
        cls, projector: AuditProjector, camera: AuditCamera, samples: AuditSamples
    ) -> "PairGeometry":
        """Look at lit and seen samples with a pair."""
        points, normal = samples.points, samples.normals
        light, _ = projector.light.to_points(points)
        r, t = towards(points, camera.world_from_device[:3, 3])
        with np.errstate(divide="ignore", invalid="ignore"):
            m, spacing = _surfaces(projector, points, light, r)
            levers = dot(normal, r) / dot(m, r)
            w = normal - m * levers[:, None]
            turn = camera.world_from_device[:3, :3]
            local = in_frame(camera.world_from_device, points)
            g = pixel_gradient(camera.device, local, w @ turn)
            per_px = t * np.hypot(*g.T)
            pitch = spacing * np.abs(levers) / per_px
        return cls(
            *(projector, camera, points, m, w, levers, g, per_px),
            *(-dot(normal, light), normal),
            np.abs(dot(r, m)),
            pitch,
            np.arctan2(lengths(cross(light, r)), dot(light, r)),
        )

    def levels(self, light: LightBudget) -> LightLevels:
        """Return how bright the samples come out in the camera."""
        levels = LightLevels.of(light, self.projector, self.points, self.normals)
        return levels.seen(self.camera, self.points)


def _surfaces(
    projector: AuditProjector, points: Array, light: Array, rays: Array
) -> tuple[Array, Array]:
    """Return m (n, 3), and how far rings are apart along it (n,) [m]; inf: no rings."""
    if projector.code is not None:
        across = cross(light, cross(rays, light))
        across = across / lengths(across)[:, None]
        return across, np.full(len(points), np.inf)
    gradient = projector.ring_gradient(points)
    steepness = lengths(gradient)
    gap = projector.ring_gap(projector.ring_coordinate(points))
    return gradient / steepness[:, None], gap / steepness


def deviation(terms: dict[str, Array], names: Iterable[str] | None = None) -> Array:
    """Return the root of the sum of the squares of terms, all or those named, (n,)."""
    chosen = terms if names is None else [name for name in names if name in terms]
    return np.sqrt(sum(terms[name] ** 2 for name in chosen))


def error_terms(pair: PairGeometry, limits: TriangulationLimits) -> dict[str, Array]:
    """Return independent parts of the deviation along the normal [m], (n,) each."""
    with np.errstate(divide="ignore", invalid="ignore"):
        terms = {"edges": limits.noise_px / pair.incidence * pair.per_px}
        if pair.projector.code is not None:
            _, pixel_m = _panel_shifts(pair)
            told = told_px(pair, pair.projector.code, limits)
            terms["phase"] = told * pixel_m * np.abs(pair.levers)
        elif limits.light is not None:
            terms["light"] = light_noise_px(pair, limits) * pair.per_px
        if limits.ring_sigma_m is not None:
            terms["rings"] = limits.ring_sigma_m * np.abs(pair.levers)
        if limits.drawn_edges is not None:
            terms["linearity"] = drawn_off(pair, limits.drawn_edges) * np.abs(
                pair.levers
            )
        if limits.calibration is None:
            return terms
        angle, position, focal, principal = (
            limits.calibration.angle / np.sqrt(3.0),
            limits.calibration.position_m / np.sqrt(3.0),
            limits.calibration.focal,
            limits.calibration.principal_px / np.sqrt(2.0),
        )
        for name, device, across, (longer, per_px) in (
            ("camera", pair.camera, pair.w, _image_shifts(pair)),
            ("projector", pair.projector, pair.m, _panel_shifts(pair)),
        ):
            offset = pair.points - device.world_from_device[:3, 3]
            terms[name] = np.sqrt(
                (angle * lengths(cross(offset, across))) ** 2
                + position**2 * dot(across, across)
                + (focal * longer) ** 2
                + (principal * per_px) ** 2
            )
        terms["projector"] *= np.abs(pair.levers)
    return terms


def light_noise_px(pair: PairGeometry, limits: TriangulationLimits) -> Array:
    """Return the noise that photons and pixels leave to edges [px], (n,); 0: unsaid."""
    if limits.light is None:
        return np.zeros(len(pair.points))
    side, blur = _blur(pair, limits.drawn_edges or DrawnEdges())
    # An edge is drawn as a ramp of two pixels, over squares, rounded to a square.
    ramp = side**2 * (4.0 + 1.0 + 1.0) / 12.0
    across = pair.per_px / np.abs(pair.levers)
    return pair.levels(limits.light).noise_px(np.sqrt(blur + ramp) / across)


def told_px(pair: PairGeometry, code: DenseCode, limits: TriangulationLimits) -> Array:
    """Return how exactly a code is told, in pixels of the panel, shape (n,)."""
    if code.shifts == 0:
        return np.full(len(pair.points), 12.0**-0.5)
    side, variance = _blur(pair, limits.drawn_edges or DrawnEdges())
    waves = np.pi * np.sqrt(variance) / (side * code.period_px)
    left = np.exp(-2.0 * waves**2)
    if limits.light is None:
        radians = code.phase_noise / pair.incidence / left
    else:
        radians = pair.levels(limits.light).phase_noise(code.shifts) / left
    return radians / (2.0 * np.pi / code.period_px)


def drawn_off(pair: PairGeometry, drawn: DrawnEdges) -> Array:
    """Return what blur leaves of the panel's pixels, along m, rms [m], (n,)."""
    side, variance = _blur(pair, drawn)
    stairs = np.exp(-2.0 * np.pi**2 * variance / side**2) / (np.sqrt(2.0) * np.pi)
    return side * np.sqrt(stairs**2 + 0.005**2)


def _blur(pair: PairGeometry, drawn: DrawnEdges) -> tuple[Array, Array]:
    """Return sides of the panel's pixels, and the blur's variance along m, (n,)."""
    z = in_frame(pair.projector.world_from_device, pair.points)[:, 2]
    across = pair.per_px / np.abs(pair.levers)
    variance = drawn.in_focus_m**2 + (drawn.camera_px * across) ** 2
    if drawn.focus_m is not None:
        disc = drawn.aperture_m * np.abs(z - drawn.focus_m) / drawn.focus_m
        variance = variance + (disc / 4.0) ** 2
    return pair.projector.light.pixel_sides(z), variance


def _image_shifts(pair: PairGeometry) -> tuple[Array, Array]:
    """Return what a focal length doubled, and 1 px, move the points by [m], (n,)."""
    local = in_frame(pair.camera.world_from_device, pair.points)
    return lens_shifts(pair.camera.device, local, pair.gradient)


def _panel_shifts(pair: PairGeometry) -> tuple[Array, Array]:
    """Return the same of the projector's panel, across the ring surfaces."""
    pose = pair.projector.world_from_device
    local = in_frame(pose, pair.points)
    return pair.projector.light.panel_shifts(local, pair.m @ pose[:3, :3])
