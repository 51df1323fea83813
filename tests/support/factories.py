"""Rigs, requirements, scenes and devices without a pose, made in one line each."""

from typing import Any

import numpy as np

from geometry.mesh.mesh import TriangleMesh
from planning import Rig, load_rig
from planning.model.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import Requirements
from planning.rig.wishes import Wishes
from planning.scene.scene import Scene

TAU_M = 0.004


def make_rig(light: str = "diverging") -> Rig:
    """The default rig under a light."""
    return load_rig("default", light=light)


def make_requirements(
    mesh: TriangleMesh, rig: Rig, *, tau_m: float = TAU_M, **wishes: Any
) -> Requirements:
    """What the rig asks of a mesh, whose whole surface is the target by default."""
    asked = Wishes(**({"target": "surface"} | wishes))
    return rig.requirements(mesh.centre, mesh.radius, asked, tau_m=tau_m)


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


def make_projector(rig: Rig, radii: Any, **changes: Any) -> PlannedProjector:
    """The rig's projector at the origin, with rings of these radii."""
    pose = {"world_from_device": np.eye(4), "world_from_ring": np.eye(4)}
    device = {"device": rig.projector_device(), "ring_radii": np.asarray(radii)}
    return PlannedProjector(
        **({"id": "", "light": rig.light} | pose | device | changes)
    )


def make_camera(rig: Rig, **changes: Any) -> PlannedCamera:
    """The rig's camera at the origin."""
    whole = {"id": "", "world_from_device": np.eye(4), "device": rig.camera_device()}
    return PlannedCamera(**(whole | changes))
