"""s_N, pitch and |r.m| against finite differences of the exact triangulation."""

import numpy as np
import pytest
from scipy.optimize import brentq

from geometry.devices import ParallelModel, PinholeModel
from geometry.mesh.sampling import SurfaceSamples
from geometry.poses import inverse, look_at, transform
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.requirements import CameraLimits, TriangulationLimits
from planning.scene import lighting
from planning.scene.codes.patterns import pattern_of
from planning.scene.limits import camera_limits, pair_limits
from planning.scene.measuring import measurability
from planning.scene.samples import Target

UP = np.array([0.0, 0.0, 1.0])
CAMERA = PinholeModel(
    np.array([[2000.0, 0, 1023.5], [0, 2100.0, 767.5], [0, 0, 1]]),
    (2048, 1536),
    (0.2, 3.0),
    (0.05, -0.02, 0.001, -0.002, 0.0),
)
PROJECTOR = PinholeModel(
    np.array([[1400.0, 0, 511.5], [0, 1400.0, 900.0], [0, 0, 1]]), (1024, 768), (0.2, 3)
)
LIMITS = TriangulationLimits(0.1, 0.1, max_sigma_m=1.0, min_ring_pitch_px=1e-3)


def ring_pose(device_pose, tilt):
    turn = np.eye(4)
    c, s = np.cos(tilt), np.sin(tilt)
    turn[:3, :3] = [[1, 0, 0], [0, c, -s], [0, s, c]]
    return device_pose @ turn


def projector(light, position, tilt=0.15):
    pose = look_at(np.array(position), np.zeros(3), UP)
    if light == "diverging":
        radii = np.linspace(0.004, 0.6, 150)
        return PlannedProjector(
            "P1", light, pose, ring_pose(pose, tilt), PROJECTOR, radii
        )
    shifted = pose.copy()
    shifted[:3, 3] += pose[:3, :3] @ [0.05, -0.1, 0.0]
    device = ParallelModel((1024, 768), 1e-3, (0.2, 3.0))
    return PlannedProjector(
        "P1", light, pose, shifted, device, np.linspace(0.004, 0.6, 150)
    )


def one_sample(point, normal, steep=(0.0, 0.0, 0.0)):
    samples = SurfaceSamples(
        np.array([point]), np.array([normal]), np.zeros(1, dtype=np.int64), 1.0
    )
    return Target(samples, np.array([steep]))


def ring_value(source, point):
    """The ring coordinate, by its definition."""
    ring = transform(inverse(source.world_from_ring), np.array([point]))[0]
    rho = np.hypot(ring[0], ring[1])
    return rho if source.light == "parallel" else rho / ring[2]


def pair(source, camera, target):
    light = lighting.light_on(source, target)
    rings = pattern_of(source).surfaces(target.samples.points)
    seen = measurability.view(camera, target, CameraLimits(np.radians(80)), None)
    return (
        measurability.pair_quality(target.samples.normals, light, rings, seen, LIMITS),
        rings,
        light,
    )


SETUPS = [
    (light, np.array(point), np.array(normal) / np.linalg.norm(normal), position)
    for light in ("diverging", "parallel")
    for point, normal, position in (
        ([0.01, 0.02, 0.03], [0.1, -1.0, 0.3], [0.7, -0.8, 0.3]),
        ([0.12, -0.05, -0.08], [0.4, -0.8, -0.1], [-0.4, -0.9, 0.4]),
        ([-0.1, 0.03, 0.1], [-0.3, -1.0, 0.2], [0.1, -0.9, 0.8]),
        ([-0.06, 0.0, -0.12], [0.2, -0.9, -0.4], [0.8, -0.6, 0.5]),
    )
]


@pytest.mark.parametrize(("light", "point", "normal", "position"), SETUPS)
def test_sigma_is_the_shift_along_the_normal_of_the_exact_triangulation(
    light, point, normal, position
):
    """Displace the edge in the image along its normal and triangulate exactly."""
    source = projector(light, [0.05, -1.1, 0.1])
    pose = look_at(np.array(position), np.array([0.02, 0.0, 0.01]), UP)
    camera = PlannedCamera("C1", pose, CAMERA)
    quality, rings, lit = pair(source, camera, one_sample(point, normal))
    tangent = np.cross(normal, rings.normals[0])
    across = edge_normal_in_image(camera, point, tangent)
    pixel = pixel_of(camera, point)
    value = ring_value(source, point)
    distance = np.linalg.norm(point - pose[:3, 3])

    def shift(step):
        ray = pose[:3, :3] @ CAMERA.rays(pixel + step * across)

        def miss(t):
            return ring_value(source, pose[:3, 3] + t * ray) - value

        t = brentq(miss, distance - 2e-4, distance + 2e-4, xtol=1e-15)
        return normal @ (pose[:3, 3] + t * ray - point)

    step = 1e-3
    slope = abs(shift(step) - shift(-step)) / (2 * step)
    noise = LIMITS.noise_px / lit.incidence_cos[0]
    assert quality.sigma[0] == pytest.approx(noise * slope, rel=2e-4)


@pytest.mark.parametrize(("light", "point", "normal", "position"), SETUPS)
def test_pitch_is_the_distance_of_the_next_ring_in_the_image(
    light, point, normal, position
):
    source = projector(light, [0.05, -1.1, 0.1])
    pose = look_at(np.array(position), np.array([0.02, 0.0, 0.01]), UP)
    camera = PlannedCamera("C1", pose, CAMERA)
    quality, rings, _ = pair(source, camera, one_sample(point, normal))
    tangent = np.cross(normal, rings.normals[0])
    tangent /= np.linalg.norm(tangent)
    climb = np.cross(tangent, normal)
    across = edge_normal_in_image(camera, point, tangent)
    index = np.searchsorted(source.ring_radii, ring_value(source, point))
    gap = source.ring_radii[index] - source.ring_radii[index - 1]
    # How far on the surface, to first order, until the ring coordinate has risen a gap.
    small = 1e-6
    rise = (
        ring_value(source, point + small * climb)
        - ring_value(source, point - small * climb)
    ) / (2 * small)
    step = 1e-6
    moved = pixel_of(camera, point + step * climb) - pixel_of(camera, point)
    expected = abs(moved @ across) / step * gap / abs(rise)
    assert quality.pitch[0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_ring_normal_is_the_gradient_and_spacing_the_gap_over_its_length(light):
    source = projector(light, [0.05, -1.1, 0.1])
    point = np.array([0.11, 0.02, -0.07])
    rings = pattern_of(source).surfaces(point[None])
    step = 1e-6
    gradient = np.array(
        [
            ring_value(source, point + step * e) - ring_value(source, point - step * e)
            for e in np.eye(3)
        ]
    ) / (2 * step)
    length = np.linalg.norm(gradient)
    np.testing.assert_allclose(rings.normals[0], gradient / length, atol=1e-7)
    gap = source.ring_radii[1] - source.ring_radii[0]
    assert rings.spacing[0] == pytest.approx(gap / length, rel=1e-6)


def test_a_camera_on_the_thales_circle_is_blind():
    """Parallel light: where P - w is across P in the panel's plane, r.m = 0."""
    source = projector("parallel", [0.0, -1.0, 0.0])
    source = PlannedProjector(
        "P1",
        "parallel",
        source.world_from_device,
        source.world_from_device,
        source.device,
        source.ring_radii,
    )
    foot = np.array([0.4, 0.0, 0.0])
    camera_at = foot + [0.0, -0.9, 0.0]
    pose = look_at(camera_at, np.zeros(3), UP)
    camera = PlannedCamera("C1", pose, CAMERA)
    angle = np.radians(35.0)
    on_circle = foot / 2 + 0.2 * np.array([-np.cos(angle), 0.0, np.sin(angle)])
    quality, _, _ = pair(source, camera, one_sample(on_circle, [0.0, -1.0, 0.0]))
    assert quality.conditioning[0] < 1e-12
    stage = measurability.first_pair_failure(quality, LIMITS)
    assert pair_limits.CAUSES[stage[0]] == "conditioning"
    # A limit of pairs knows where both devices stand.
    to_camera = quality.view.distances[:, None] * quality.view.rays
    between = quality.light.offsets - to_camera
    assert np.allclose(between, camera_at - source.world_from_device[:3, 3])


def test_the_first_limit_that_fails_is_named_in_order():
    quality = pair_limits.PairQuality(
        np.array([0.05, 0.5, 0.5, 0.5, np.nan]),
        np.array([9.0, 9.0, 1e-4, 1e-4, 1e-4]),
        {},
        np.array([0.1, 0.1, 0.1, 9.0, 9.0]),
        *(None, None, None, None),
    )
    limits = TriangulationLimits(0.1, 0.1, max_sigma_m=1e-3, min_ring_pitch_px=6.0)
    stage = measurability.first_pair_failure(quality, limits)
    names = [*pair_limits.CAUSES, "measured"]
    assert [names[i] for i in stage] == [
        "conditioning",
        "sigma",
        "pitch",
        "measured",
        "conditioning",
    ]


def test_view_names_the_first_limit_that_fails():
    pose = look_at(np.array([0.0, -1.0, 0.0]), np.zeros(3), UP)
    camera = PlannedCamera("C1", pose, CAMERA)
    points = np.array([[2.0, 0, 0], [0, 9.0, 0], [0, 0, 0], [0.1, 0, 0], [0, 0, 0.1]])
    normals = np.array([[0, -1.0, 0], [0, -1, 0], [1, 0, 0], [0, -1, 0], [0, -1, 0]])
    samples = SurfaceSamples(points, normals, np.zeros(5, dtype=np.int64), 1.0)
    target = Target(samples, np.zeros((5, 3)))
    limits = CameraLimits(np.radians(70), max_sample_distance_m=0.0005)
    stage = measurability.view(camera, target, limits, None).first_violated
    names = [*camera_limits.SEEN_CAUSES, "seen"]
    assert [names[i] for i in stage] == [
        "camera_field",
        "camera_range",
        "camera_incidence",
        "seen",
        "seen",
    ]
    coarse = CameraLimits(np.radians(70), max_sample_distance_m=0.00048)
    stage = measurability.view(camera, target, coarse, None).first_violated
    assert names[stage[3]] == "sample_distance"


def pixel_of(camera, point):
    local = transform(inverse(camera.world_from_device), np.array([point]))
    return camera.device.project(local)[0]


def edge_normal_in_image(camera, point, tangent):
    step = 1e-6
    along = pixel_of(camera, point + step * tangent) - pixel_of(camera, point)
    along /= np.linalg.norm(along)
    return np.array([-along[1], along[0]])
