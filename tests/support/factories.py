"""Rigs, requirements, scenes and devices without a pose, made in one line each."""

from dataclasses import replace
from typing import Any

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from planning import Rig, load_rig
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import Requirements, Workspace
from planning.rig.wishes import Wishes
from planning.scene.lights import ring_frame
from planning.scene.scene import Scene

TAU_M = 0.004
# Of a rig file, for tests that aren't about what a calibration leaves.
EXACT = "[calibration]\nangle_deg = 0.0\nposition_mm = 0.0\n"
# A rig file of few candidates; tables of its own may follow.
FEW_CANDIDATES = f"""
base = "default"
name = "few candidates"
{EXACT}
[placement]
n_candidate_projectors = 60
n_candidate_cameras = 60
n_reference_projectors = 600
n_reference_cameras = 400
"""


def make_rig(light: str = "diverging") -> Rig:
    """The default rig under a light."""
    return load_rig("default", light=light)


def make_requirements(
    mesh: TriangleMesh, rig: Rig, *, tau_m: float = TAU_M, **wishes: Any
) -> Requirements:
    """What the rig asks of a mesh, whose whole surface is the target by default.

    Its calibration is left out: what one costs has tests of its own.
    """
    asked = Wishes(**({"target": "surface"} | wishes))
    required = rig.requirements(mesh.centre, mesh.radius, asked, tau_m=tau_m)
    bare = replace(required.triangulation, calibration=None)
    return replace(required, triangulation=bare)


def make_scene(
    mesh: TriangleMesh,
    required: Requirements,
    *,
    region: np.ndarray | None = None,
    steep: np.ndarray | None = None,
) -> Scene:
    """A scene without regions or steep directions, unless they are given."""
    n = len(mesh.faces)
    return Scene(
        mesh,
        np.full(n, -1) if region is None else region,
        np.zeros((n, 3)) if steep is None else steep,
        required,
        seed=0,
        threads=1,
    )


def make_workspace(object_radius: float, away: float, **changes: Any) -> Workspace:
    """The whole shell at one distance about an object at the origin."""
    values = {
        "centre": (0.0, 0.0, 0.0),
        "object_radius_m": object_radius,
        "up": (0.0, 0.0, 1.0),
        "axis": (0.0, 0.0, 1.0),
        "half_angle": np.pi,
        "projector_radius_m": (away, away),
        "camera_radius_m": (away, away),
        "floor_m": None,
        "n_reference_projectors": 1,
        "n_reference_cameras": 1,
        "reference_ring_radius": 1.0,
    }
    return Workspace(**(values | changes))


def make_projector(
    rig: Rig, radii: Any, ring_offset: tuple[float, float] = (0.0, 0.0), **changes: Any
) -> PlannedProjector:
    """The rig's projector at the origin, with rings of these radii."""
    optics = rig.projector_device()
    ring = ring_frame(np.eye(4), optics, *ring_offset)
    pose = {"world_from_device": np.eye(4), "world_from_ring": ring}
    device = {"device": optics, "ring_radii": np.asarray(radii)}
    return PlannedProjector(
        **({"id": "", "light": rig.light} | pose | device | changes)
    )


def make_camera(rig: Rig, **changes: Any) -> PlannedCamera:
    """The rig's camera at the origin."""
    whole = {"id": "", "world_from_device": np.eye(4), "device": rig.camera_device()}
    return PlannedCamera(**(whole | changes))
