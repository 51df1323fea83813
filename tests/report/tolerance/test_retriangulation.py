import numpy as np
import pytest
from support.factories import make_camera, make_projector, make_rig
from support.simulated_rigs import off_by, triangulated

from geometry.poses import inverse, look_at
from planning.model.devices.device_poses import moved_to
from planning.report.tolerance.retriangulation import retriangulated

_POINTS = np.random.default_rng(5).uniform(-0.05, 0.05, (40, 3))
_UP = np.array([0.0, 0.0, 1.0])
_RADII = np.linspace(0.002, 0.3, 150)
# Displacement, turn, focal length, principal point.
_SIZES = np.array([1e-4] * 3 + [3e-4] * 3 + [4e-4] + [0.4] * 2)


def _devices(light):
    rig = make_rig(light)
    projector = make_projector(rig, _RADII)
    projector = moved_to(projector, look_at([0.1, -1.1, 0.2], np.zeros(3), _UP))
    camera = make_camera(rig)
    return projector, moved_to(camera, look_at([0.7, -0.8, -0.3], np.zeros(3), _UP))


def _as_there(off, parallel):
    """The same numbers in the order and with the signs of the simulated rigs."""
    there = np.concatenate([off[3:6], off[:3], off[6:]])
    if parallel:
        there[6] = 1.0 / (1.0 + off[6]) - 1.0
        there[7:] *= -1.0
    return there


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_points_lie_where_newtons_method_puts_them(light):
    projector, camera = _devices(light)
    rng = np.random.default_rng(1)
    edges = 0.1 * rng.standard_normal((len(_POINTS), 2))
    for _ in range(5):
        off_p, off_c = rng.standard_normal((2, 9)) * _SIZES
        found = retriangulated(
            _POINTS, projector, camera, (off_p, off_c), edge_px=edges
        )
        there = triangulated(
            _POINTS,
            projector,
            camera,
            off_by(projector, _as_there(off_p, light == "parallel")),
            off_by(camera, _as_there(off_c, False)),
            noise_px=edges,
        )
        some = np.isfinite(there[:, 0])
        assert some.mean() > 0.8
        assert np.abs(found - there)[some].max() < 1e-8
        assert np.abs(found - _POINTS)[some].max() > 1e-4


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_exact_devices_find_the_point_and_shifted_rings_miss_by_their_shift(light):
    projector, camera = _devices(light)
    nothing = np.zeros(9), np.zeros(9)
    found = retriangulated(_POINTS, projector, camera, nothing)
    assert np.abs(found - _POINTS).max() < 1e-12
    shift = 2e-8
    moved = retriangulated(_POINTS, projector, camera, nothing, ring_m=shift) - found
    local = (_POINTS - projector.world_from_ring[:3, 3]) @ projector.world_from_ring[
        :3, :3
    ]
    rho = np.hypot(*local[:, :2].T)
    slope = 0.0 if light == "parallel" else rho / local[:, 2]
    m = np.column_stack(
        [local[:, :2] / rho[:, None], np.broadcast_to(-slope, rho.shape)]
    )
    m /= np.sqrt(1.0 + np.square(slope)).reshape(-1, 1) if light != "parallel" else 1.0
    along = np.einsum("ij,ij->i", moved @ projector.world_from_ring[:3, :3], m)
    assert along == pytest.approx(shift, rel=2e-3)


def test_a_ray_that_passes_its_ring_by_has_no_point():
    projector, camera = _devices("diverging")
    # Along the rings' axis the innermost rings are met by few rays.
    at_axis = projector.world_from_ring @ [0.0, 2e-5, 1.1, 1.0]
    far_off = np.zeros(9)
    far_off[3:6] = [2e-3, 2e-3, 2e-3]
    lost = retriangulated(at_axis[None, :3], projector, camera, (np.zeros(9), far_off))
    assert np.isnan(lost).all()
    assert np.linalg.norm(inverse(camera.world_from_device)[:3, 3]) > 0.5
