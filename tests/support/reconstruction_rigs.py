"""Hand-made plans for the tests of the check from pixels; no planner is involved."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import SurfaceSamples
from geometry.poses import look_at
from geometry.shapes.primitives import sphere
from planning.experiments.setups import Experiment
from planning.model.plan import RigPlan
from planning.model.surface import Surface
from planning.verify.reconstruction.calibration import ProjectorCalibration
from planning.verify.reconstruction.check.accuracy import Expected
from planning.verify.reconstruction.check.result import Reconstruction
from planning.verify.reconstruction.reconstruct import reconstruct
from planning.verify.reconstruction.scanner import Scanner
from support.bare_plan import bare_plan

MESH_TABLE = {
    "path": None,
    "sha256": None,
    "unit": "m",
    "scale_to_m": 1.0,
    "n_vertices": 3,
    "n_faces": 1,
    "area_m2": 1.0,
}
CHECK = {
    "max_rms_m": 1e-4,
    "max_p95_m": 3e-4,
    "max_bias_m": 3e-5,
    "tau_m": 3.5e-3,
    "min_completeness": 0.90,
    "max_predicted_missing": 0.01,
}
UP = np.array([0.0, 0.0, 1.0])


def bumpy_sphere(radius: float, *, subdivisions: int = 5) -> TriangleMesh:
    """A sphere with low waves: a closed, smooth body that isn't round."""
    ball = sphere(1.0, subdivisions=subdivisions)
    x, y, z = ball.vertices.T
    wave = 0.05 * np.sin(5.0 * x) * np.cos(4.0 * y + 1.0) + 0.04 * np.sin(6.0 * z)
    return TriangleMesh(radius * (1.0 + wave)[:, None] * ball.vertices, ball.faces)


def ringed(projector: ProjectorCalibration, radii: np.ndarray) -> ProjectorCalibration:
    """A projector that draws other rings."""
    return replace(projector, pattern=replace(projector.pattern, radii=radii))


def direction(azimuth_deg: float, elevation_deg: float) -> np.ndarray:
    a, e = np.deg2rad([azimuth_deg, elevation_deg])
    return np.array([np.cos(e) * np.sin(a), -np.cos(e) * np.cos(a), np.sin(e)])


def turn(axis: int, degrees: float) -> np.ndarray:
    pose = np.eye(4)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    pose[i, i] = pose[j, j] = c
    pose[i, j], pose[j, i] = -s, s
    return pose


def camera(
    name: str, position: np.ndarray, *, focal: float = 3478.0, distortion=(0.0,) * 5
) -> dict[str, Any]:
    pose = look_at(position, np.zeros(3), UP)
    return {
        "id": name,
        "world_from_device": pose.tolist(),
        "K": [[focal, 0.0, 1023.5], [0.0, focal, 767.5], [0.0, 0.0, 1.0]],
        "distortion": list(distortion),
        "resolution": [2048, 1536],
        "range_m": [0.5, 2.0],
        "seen_area_m2": 0.0,
        "sole_area_m2": 0.0,
    }


def two_small_cameras() -> list[dict]:
    """Two cameras of 320 x 240 px, before an object of 10 cm."""
    cameras = [
        camera("C1", direction(-5.0, -20.0)),
        camera("C2", direction(10.0, 35.0)),
    ]
    for entry in cameras:
        entry["K"] = [[1600.0, 0.0, 159.5], [0.0, 1600.0, 119.5], [0.0, 0.0, 1.0]]
        entry["resolution"] = [320, 240]
    return cameras


def diverging(
    name: str, position: np.ndarray, reach: float, gap: float
) -> dict[str, Any]:
    """A 1280 x 800 projector of throw 1.4, its rings turned by 8 degrees."""
    pose = look_at(position, np.zeros(3), UP)
    away = float(np.linalg.norm(position))
    focal = 1.4 * 1280
    outer = np.tan(np.arctan(reach / away) + np.deg2rad(8.0))
    radii = np.arange(1, int(np.ceil(outer / (gap / away))) + 1) * (gap / away)
    return {
        "id": name,
        "light": "diverging",
        "world_from_device": pose.tolist(),
        "world_from_ring": (pose @ turn(0, 8.0)).tolist(),
        "K": [[focal, 0.0, 639.5], [0.0, focal, 399.5], [0.0, 0.0, 1.0]],
        "resolution": [1280, 800],
        "pixel_pitch_m": None,
        "range_m": [0.5, 2.0],
        "ring_radii": radii.tolist(),
        "beam_radius": None,
        "min_margin_rad": 0.0,
        "lit_area_m2": 0.0,
    }


def parallel(
    name: str, position: np.ndarray, reach: float, gap: float
) -> dict[str, Any]:
    """The paper's ideal beam, its ring axis shifted off the object."""
    pose = look_at(position, np.zeros(3), UP)
    shift = np.eye(4)
    shift[0, 3] = 0.14
    radii = np.arange(1, int(np.ceil((reach + 0.14) / gap)) + 1) * gap
    return {
        "id": name,
        "light": "parallel",
        "world_from_device": pose.tolist(),
        "world_from_ring": (pose @ shift).tolist(),
        "K": None,
        "resolution": [2000, 2000],
        "pixel_pitch_m": 0.2e-3,
        "range_m": [0.2, 2.0],
        "ring_radii": radii.tolist(),
        "beam_radius": 0.2,
        "min_margin_rad": 0.0,
        "lit_area_m2": 0.0,
    }


def plan_of(
    mesh: TriangleMesh,
    projectors: list[dict[str, Any]],
    cameras: list[dict[str, Any]],
    check: dict[str, float] = CHECK,
    **sections: Any,
) -> RigPlan:
    """A plan that holds what the check reads, the rest empty."""
    n = len(mesh.faces)
    surface = Surface(
        mesh,
        np.zeros(n, np.int64),
        np.zeros(n, np.int64),
        np.zeros((n, 3)),
        *(np.zeros((0, 4, 4)),) * 3,
    )
    requirements = {
        "max_projectors": len(projectors),
        "max_cameras": None,
        "coverage": 0.95,
        "dominant_coverage": 0.9,
        "min_reachable": 0.9,
        "target": "surface",
        "pattern": "rings",
        "projector": {"max_incidence": np.pi / 3, "min_tangent_angle": 0.7},
        "camera": {"max_incidence": 1.22, "max_sample_distance_m": None},
        "triangulation": {"min_conditioning": 0.1, "noise_px": 0.1},
        "check": check,
        "workspace": {
            "centre": [0.0, 0.0, 0.0],
            "object_radius_m": mesh.radius,
            "up": [0.0, 0.0, 1.0],
            "axis": [0.0, -1.0, 0.0],
            "half_angle": np.pi,
            "projector_radius_m": [0.9, 1.2],
            "camera_radius_m": [0.9, 1.2],
            "floor_m": None,
            "n_reference_projectors": 600,
            "n_reference_cameras": 400,
            "reference_ring_radius": 0.2,
        },
    }
    return bare_plan(requirements, projectors, cameras, surface, **sections)


def changed(
    plan: RigPlan,
    change: Callable[[dict[str, Any]], object],
    mesh: TriangleMesh | None = None,
) -> RigPlan:
    """A plan after its document was changed in place, perhaps about another object."""
    document = plan.to_document()
    change(document)
    surface = plan.surface if mesh is None else replace(plan.surface, mesh=mesh)
    return RigPlan.from_document(document, surface)


def reconstruct_plan(
    plan: RigPlan,
    *,
    truth: RigPlan | None = None,
    samples: SurfaceSamples | None = None,
    predicted: np.ndarray | None = None,
    **options: Any,
) -> Reconstruction:
    """Measure the object of a plan through images rendered of the plan or the truth."""
    return reconstruct(
        Scanner.of(plan),
        truth=None if truth is None else Scanner.of(truth),
        expected=None if samples is None else Expected(samples, predicted),
        **options,
    )


def small_rig(mesh: TriangleMesh, light: str = "diverging", focal: float = 3478.0):
    """Two projectors and three cameras about the front of a small body."""
    project = diverging if light == "diverging" else parallel
    reach = mesh.radius * 1.05
    return plan_of(
        mesh,
        [
            project("P1", 1.0 * direction(-35.0, 5.0), reach, 3.5e-3),
            project("P2", 1.0 * direction(35.0, 5.0), reach, 3.5e-3),
        ],
        [
            camera("C1", 1.0 * direction(0.0, -20.0), focal=focal),
            camera("C2", 1.0 * direction(-60.0, 25.0), focal=focal),
            camera("C3", 1.0 * direction(60.0, 25.0), focal=focal),
        ],
    )


def single(experiment: Experiment, *, projector: int = 0, camera: int = 0) -> Scanner:
    """One projector and one camera of an experiment."""
    scanner = experiment.scanner
    return replace(
        scanner,
        projectors=scanner.projectors[projector : projector + 1],
        cameras=scanner.cameras[camera : camera + 1],
    )


def predict_on_sphere(plan: RigPlan, samples: SurfaceSamples) -> np.ndarray:
    """Samples of a sphere about the origin that some pair measures, with a margin.

    On a convex body what faces a device is seen by it. Incidence up to 55 degrees, and
    |r.m| and the ring pitch as in docs/reference/semantics.md, 0.11 and 6 px.
    """
    measured = np.zeros(len(samples), dtype=bool)
    p, n = samples.points, samples.normals
    for projector in plan.projectors:
        pose, ring = projector.world_from_device, projector.world_from_ring
        light = np.broadcast_to(pose[:3, 2], p.shape)
        local = (p - ring[:3, 3]) @ ring[:3, :3]
        across = np.hypot(local[:, 0], local[:, 1])
        tilt, scale = np.zeros(len(p)), np.ones(len(p))
        if projector.light == "diverging":
            light = (p - pose[:3, 3]) / np.linalg.norm(p - pose[:3, 3], axis=1)[:, None]
            tilt = across / local[:, 2]
            scale = local[:, 2] / np.sqrt(1.0 + tilt**2)
        m = np.column_stack([local[:, :2] / across[:, None], -tilt])
        m = m / np.sqrt(1.0 + tilt**2)[:, None] @ ring[:3, :3].T
        gap = scale * np.diff(projector.ring_radii)[0]
        lit = -np.einsum("ij,ij->i", light, n) > np.cos(np.deg2rad(55.0))
        lit &= (tilt if scale[0] != 1.0 else across) < projector.ring_radii[-1]
        for one in plan.cameras:
            ray = p - one.world_from_device[:3, 3]
            reach = np.linalg.norm(ray, axis=1)
            ray /= reach[:, None]
            facing = -np.einsum("ij,ij->i", ray, n)
            conditioning = np.abs(np.einsum("ij,ij->i", ray, m))
            side = np.linalg.norm(np.cross(n, m), axis=1)
            tangent = np.cross(n, m) / side[:, None]
            turn = np.sqrt(1.0 - np.einsum("ij,ij->i", ray, tangent) ** 2)
            pitch = gap * facing * one.device.focal_px / (reach * side * turn)
            measured |= (
                lit
                & (facing > np.cos(np.deg2rad(55.0)))
                & (conditioning > 0.11)
                & (pitch > 6.0)
            )
    return measured
