"""Hand-made projectors and cameras that code every pixel, and what they see."""

from collections.abc import Sequence

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from geometry.poses import look_at
from geometry.rays.rays import RayCaster
from planning.model.light.dense_code import DenseCode
from planning.model.requirements import CheckLimits
from planning.verify.reconstruction.calibration import (
    CameraCalibration,
    ProjectorCalibration,
)
from planning.verify.reconstruction.light_laws import LIGHTS, LightName
from planning.verify.reconstruction.patterns.dense_patterns import DensePattern
from planning.verify.reconstruction.patterns.ring_patterns import DrawnRings, Frames
from planning.verify.reconstruction.render.dense_render import render_dense
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.rendered_light import Shown
from planning.verify.reconstruction.render.view import view
from planning.verify.reconstruction.scanner import ScanLimits, Scanner

UP = np.array([0.0, 0.0, 1.0])
PLAIN = (0.0,) * 5
BENT = (-0.12, 0.05, 0.001, -0.002, 0.01)

_CODE, _LIGHT = DenseCode(), Photometry()


def pose_at(position: Sequence[float]) -> np.ndarray:
    """A device that looks at the origin."""
    return look_at(np.array(position, dtype=float), np.zeros(3), UP)


def camera_at(
    name: str,
    position: Sequence[float],
    *,
    focal: float = 900.0,
    size: tuple[int, int] = (320, 240),
    lens: tuple[float, ...] = PLAIN,
) -> CameraCalibration:
    matrix = np.diag([focal, focal, 1.0])
    matrix[:2, 2] = 0.5 * (size[0] - 1), 0.5 * (size[1] - 1)
    return CameraCalibration(name, pose_at(position), matrix, size, lens)


def projector_at(
    name: str,
    position: Sequence[float],
    *,
    code: DenseCode = _CODE,
    light: LightName = "diverging",
    size: tuple[int, int] = (640, 400),
    lens: tuple[float, ...] = PLAIN,
) -> ProjectorCalibration:
    """Of throw 1.4; in parallel light pixels are 0.3 mm apart."""
    scale = 1.4 * size[0] if light == "diverging" else 1.0 / 0.3e-3
    matrix = np.diag([scale, scale, 1.0])
    matrix[:2, 2] = 0.5 * (size[0] - 1), 0.5 * (size[1] - 1)
    pose = pose_at(position)
    return ProjectorCalibration(
        name,
        pose,
        matrix,
        size,
        pose,
        None if light == "diverging" else 0.15,
        DrawnRings(LIGHTS[light], np.zeros(0)),
        dense=DensePattern(code, size),
        distortion=lens,
    )


def frames_of(
    mesh: TriangleMesh,
    projector: ProjectorCalibration,
    camera: CameraCalibration,
    photometry: Photometry = _LIGHT,
    seed: int = 1,
) -> Frames:
    """What a camera records under a projector."""
    caster = RayCaster(mesh, threads=1)
    seen = view(camera, mesh, caster, photometry)
    assert seen is not None
    shown = Shown(projector, projector, projector.pattern_for(camera), caster)
    return render_dense(seen, shown, photometry, (seed, 0, 0))


def square(side_m: float, *, tilt: float = 0.0) -> TriangleMesh:
    """A square about the origin across -y, turned about z by tilt [rad]."""
    half = 0.5 * side_m
    across = half * np.array([np.cos(tilt), np.sin(tilt), 0.0])
    up = half * UP
    corners = np.array([-across - up, across - up, across + up, -across + up])
    return TriangleMesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def dense_scanner(
    mesh: TriangleMesh,
    projectors: Sequence[ProjectorCalibration],
    cameras: Sequence[CameraCalibration],
    **limits: float,
) -> Scanner:
    check = CheckLimits(
        max_rms_m=2e-4,
        max_p95_m=4e-4,
        max_bias_m=5e-5,
        tau_m=2e-3,
        min_completeness=0.9,
        max_predicted_missing=0.01,
        ambient=0.05,
    )
    return Scanner(
        tuple(projectors),
        tuple(cameras),
        mesh,
        np.zeros(len(mesh.faces), dtype=np.int64),
        np.ones(len(mesh.faces), dtype=bool),
        ScanLimits(check, 0.1, np.deg2rad(60.0), np.deg2rad(70.0), **limits),
    )
