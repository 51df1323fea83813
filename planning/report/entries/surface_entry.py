"""What `surface.npz` holds of a plan in the making."""

from collections.abc import Sequence

import numpy as np

from geometry.arrays import Array, Ints
from planning.model.devices.bodies import Obstacle
from planning.model.surface import Surface
from planning.report.claims.judged import Devices
from planning.report.partial_plan import Prepared
from planning.scene.placed_bodies import Device
from planning.scene.scene import Scene


def surface_of(scene: Scene, devices: Devices, ready: Prepared) -> Surface:
    """Return mesh, regions, reference sets and what stands about, as planned with."""
    reference, views = devices.reference_projectors, devices.reference_cameras
    return Surface(
        scene.mesh,
        np.zeros(len(scene.mesh.faces), dtype=np.int64),
        scene.region,
        scene.steep,
        _poses([p.world_from_device for p in reference]),
        _poses([p.world_from_ring for p in reference]),
        _poses([c.world_from_device for c in views]),
        tuple(
            Obstacle(solid.name, solid.mesh, solid.station)
            for solid in scene.obstructions
        ),
        _models_of(reference, ready.templates),
        _models_of(views, ready.cameras),
    )


def _poses(poses: Sequence[Array]) -> Array:
    return np.array(poses, dtype=np.float64).reshape(-1, 4, 4)


def _models_of(reference: Sequence[Device], templates: Sequence[Device]) -> Ints | None:
    """Model of each reference pose by its place; None where there is but one."""
    if len(templates) == 1:
        return None
    place = {template.model: k for k, template in enumerate(templates)}
    return np.array([place[device.model] for device in reference], dtype=np.int64)
