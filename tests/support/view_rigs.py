"""Cameras alone about an object: scenes for the planner, scanners for the check."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from geometry.poses import look_at
from planning.model.devices.planned import PlannedCamera
from planning.scene.samples import Target
from planning.scene.scene import Scene
from planning.verify.reconstruction.calibration import CameraCalibration
from planning.verify.reconstruction.scanner import Scanner
from support.dense_rigs import dense_scanner
from support.factories import make_camera, make_requirements, make_rig, make_scene

UP = np.array([0.0, 0.0, 1.0])


def alone_scene(mesh: TriangleMesh, *, views: int = 2, **wishes: object) -> Scene:
    """A scene of the default rig whose cameras measure by each other."""
    asked = {"max_projectors": 0, "pattern": "none", "views": views} | wishes
    required = make_requirements(mesh, make_rig(), **asked)
    return make_scene(mesh, required)


def camera_towards(
    position: Sequence[float], at: Sequence[float] = (0.0, 0.0, 0.0), **changes: object
) -> PlannedCamera:
    """A camera of the default rig that looks at a place."""
    pose = look_at(np.array(position, dtype=float), np.array(at, dtype=float), UP)
    return make_camera(make_rig(), world_from_device=pose, **changes)


def cameras_about(n: int, away: float, seed: int) -> tuple[PlannedCamera, ...]:
    """Cameras at random about the origin."""
    rng = np.random.default_rng(seed)
    ways = rng.standard_normal((n, 3))
    ways *= away / np.linalg.norm(ways, axis=1)[:, None]
    return tuple(
        replace(camera_towards(way), id=f"C{k + 1}") for k, way in enumerate(ways)
    )


def some_samples(scene: Scene, n: int) -> Target:
    """The first of the samples on which areas are claimed."""
    from planning.scene.draws import DRAWS

    return scene.target_samples(DRAWS.claims.of(n))


def view_scanner(mesh: TriangleMesh, cameras: Sequence[CameraCalibration]) -> Scanner:
    """A scanner of cameras alone, whose rays meet at 8 to 60 degrees."""
    angles = {"min_angle": np.deg2rad(8.0), "max_angle": np.deg2rad(60.0)}
    scanner = dense_scanner(mesh, [], cameras, **angles)
    # Points two pixels apart, which costs less than at every pixel.
    check = replace(scanner.limits.check, tau_m=5e-3)
    return replace(scanner, limits=replace(scanner.limits, check=check))
