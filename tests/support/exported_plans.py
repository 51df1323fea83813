"""A plan with everything that exporters must hold, and points for each device."""

import numpy as np

from geometry.devices import PinholeModel, turned_to
from planning.handover.export.exported_rig import ExportedDevice
from planning.model.plan import RigPlan
from support import reconstruction_rigs as rigs

BODY = {"centre_m": [0.01, 0.0, -0.06], "half_m": [0.03, 0.025, 0.05]}
FLOOR_M = -0.4


def exported_plan(
    *, parallel: bool = True, distorted: bool = True, subdivisions: int = 3
) -> RigPlan:
    """Lens shift in both axes, pixels that aren't square, mounts, housings.

    P2 is of parallel light, C1's lens distorts, C2 looks straight down, C3 stands
    already.
    """
    ball = rigs.bumpy_sphere(0.05, subdivisions=subdivisions)
    shifted = rigs.diverging("P1", rigs.direction(-35.0, 5.0), 0.055, 3.5e-3)
    shifted["K"] = [[1792.3456789, 0, 640.256789], [0, 1780.87654321, 820.1], [0, 0, 1]]
    # The middle of its image looks at the object, as a planned one's does.
    lens = PinholeModel(np.array(shifted["K"]), (1280, 800), (0.5, 2.0))
    pose = np.array(shifted["world_from_device"])
    pose[:3, :3] = pose[:3, :3] @ turned_to(lens.middle_ray)
    shifted["world_from_device"] = np.round(pose, 12).tolist()
    projectors = [shifted]
    if parallel:
        projectors.append(rigs.parallel("P2", rigs.direction(35.0, 5.0), 0.055, 3.5e-3))
    bent = (-0.12, 0.08, 0.001, -0.0008, 0.02) if distorted else (0.0,) * 5
    cameras = [
        rigs.camera("C1", rigs.direction(0.0, -20.0), distortion=bent),
        rigs.camera("C2", rigs.direction(0.0, 90.0)),
        rigs.camera("C3", rigs.direction(60.0, 25.0), focal=3478.123456789),
    ]
    cameras[1]["K"] = [
        [3478.123457, 0, 1000.512345],
        [0, 3478.123457, 767.5],
        [0, 0, 1],
    ]
    cameras[2] |= {"existing": True, "name": "left wing"}
    for entry in (*projectors, *cameras):
        entry["body"] = BODY
    # A thread in the floor of the housing: z down out of it, x ahead.
    mount = np.eye(4)
    mount[:3, 0], mount[:3, 1], mount[:3, 2] = [0, 0, 1], [1, 0, 0], [0, 1, 0]
    mount[:3, 3] = [0.01, 0.025, -0.06]
    for entry in (shifted, cameras[0]):
        pose = np.array(entry["world_from_device"]) @ mount
        entry["world_from_mount"] = np.round(pose, 12).tolist()

    def floored(document):
        document["requirements"]["workspace"]["floor_m"] = FLOOR_M

    return rigs.changed(rigs.plan_of(ball, projectors, cameras), floored)


def points_before(device: ExportedDevice, n: int = 1000, seed: int = 0) -> np.ndarray:
    """Points (n, 3) that fill a device's image and its depth, in the export's frame."""
    rng = np.random.default_rng(seed)
    size = np.array(device.model.resolution)
    pixels = rng.uniform(-0.5, size - 0.5, (n, 2))
    depth = rng.uniform(0.8, 1.2, (n, 1)) * device.reach_m
    if device.lens is None:
        matrix = device.panel_matrix
        across = (pixels - matrix[:2, 2]) / matrix[0, 0]
        local = np.column_stack([across, depth])
    else:
        local = depth * device.lens.rays(pixels)
    pose = device.world_from_device
    return local @ pose[:3, :3].T + pose[:3, 3]
