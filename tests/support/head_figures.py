"""What a head's own geometry gives: field, baseline, points and errors on its axis."""

from dataclasses import dataclass

import numpy as np

from geometry.devices import ParallelModel, PinholeModel
from geometry.mesh.sampling import SurfaceSamples
from planning.model.devices.heads import Head, HeadDevice
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.rig.devices.rig_heads import seen_share
from planning.rig.rig import Rig
from planning.rig.wishes import Wishes
from planning.scene.codes.patterns import pattern_of
from planning.scene.lighting import light_on
from planning.scene.measuring.measurability import pair_quality, view
from planning.scene.samples import Target

# Presets with a head, by maker.
HEADS = {
    "gom-atos-core-300": "ZEISS (GOM)",
    "mech-eye-pro-s": "Mech-Mind",
    "photoneo-phoxi-l": "Photoneo",
    "shining3d-einscan-sp": "SHINING 3D",
    "zivid-2plus-l110": "Zivid",
    "zivid-2plus-m130": "Zivid",
    "zivid-2plus-m60": "Zivid",
}
# Parts of the volume's rectangles, along each side, of which the share is counted.
_FINE = 41


@dataclass(frozen=True)
class Figures:
    """Figures of a head that follow from its devices, in [m] and [rad].

    Attributes:
        depths: Near end of the stated volume, working distance, far end.
        covered: Share of the volume's rectangle there that a pair images sharply.
        baseline: From the projector to the farthest camera.
        point_distance: Of neighbouring pixels of a camera, on a plane across the axis
            at `at_m`, or at the working distance.
        sigma: Least s_N of a plane across the axis over the pairs, at each depth.
        angle: At which ray and light of the first pair meet at the working distance.
    """

    depths: tuple[float, ...]
    covered: tuple[float, ...]
    baseline: float
    point_distance: float
    sigma: tuple[float, ...]
    angle: float


def figures_of(rig: Rig) -> Figures:
    """Return the figures of a rig's head, with a dense code and the rig's limits."""
    head = rig.head
    assert head is not None
    depths = head.volume.near_m, head.working_m, head.volume.far_m
    at = head.figures.at_m or head.working_m
    apart = [_pixel_m(rig, camera, at) for camera in head.cameras]
    return Figures(
        depths,
        tuple(
            seen_share(head, rig.optics_of, head.volume.plane(z, _FINE)) for z in depths
        ),
        head.baseline_m,
        float(np.mean(apart)),
        tuple(sigma_at(rig, depth) for depth in depths),
        _angle(head, head.working_m),
    )


def sigma_at(rig: Rig, depth: float) -> float:
    """Return the least s_N [m] of the head's pairs for a plane across its axis."""
    assert rig.head is not None
    wishes = Wishes(pattern="dense", max_projectors=1)
    required = rig.requirements(np.zeros(3), 0.01, wishes, tau_m=1.0)
    target = _on_axis(depth)
    return min(
        float(
            pair_quality(
                target.samples.normals,
                light_on(source, target),
                pattern_of(source).surfaces(target.samples.points),
                view(camera, target, required.camera, None),
                required.triangulation,
            ).sigma[0]
        )
        for source, camera in (_planned(rig, *pair) for pair in rig.head.pairs)
    )


def _on_axis(depth: float) -> Target:
    samples = SurfaceSamples(
        np.array([[0.0, 0.0, depth]]),
        np.array([[0.0, 0.0, -1.0]]),
        np.zeros(1, dtype=np.int64),
        1.0,
    )
    return Target(samples, np.zeros((1, 3)))


def _planned(
    rig: Rig, lamp: HeadDevice, eye: HeadDevice
) -> tuple[PlannedProjector, PlannedCamera]:
    """A pair of the head, in a world that is the head's frame."""
    projector = rig.optics_of("projector", lamp.model)
    camera = rig.optics_of("camera", eye.model)
    assert isinstance(camera, PinholeModel)
    assert isinstance(projector, PinholeModel | ParallelModel)
    pose = lamp.head_from_device
    source = PlannedProjector(
        "P1",
        rig.light,
        pose,
        pose,
        projector,
        np.zeros(0),
        pattern="dense",
        code=rig.table.dense.code(),
    )
    return source, PlannedCamera("C1", eye.head_from_device, camera)


def _pixel_m(rig: Rig, eye: HeadDevice, depth: float) -> float:
    """How far apart two neighbouring pixels about the axis meet its plane [m]."""
    camera = rig.optics_of("camera", eye.model)
    assert isinstance(camera, PinholeModel)
    turn, place = eye.head_from_device[:3, :3], eye.head_from_device[:3, 3]
    middle = camera.project(turn.T @ (np.array([0.0, 0.0, depth]) - place))
    rays = camera.rays(middle + np.array([[-0.5, 0.0], [0.5, 0.0]])) @ turn.T
    points = place + rays * ((depth - place[2]) / rays[:, 2:])
    return float(np.linalg.norm(points[1] - points[0]))


def _angle(head: Head, depth: float) -> float:
    point = np.array([0.0, 0.0, depth])
    one, other = ((point - device.head_from_device[:3, 3]) for device in head.pairs[0])
    cosine = one @ other / np.linalg.norm(one) / np.linalg.norm(other)
    return float(np.arccos(cosine))
