"""The cameras' bound over all poses: supersets under attack, and counts known."""

from dataclasses import replace

import numpy as np
import pytest
from support.closed_forms import round_body_limit
from support.factories import make_requirements, make_scene
from support.plain_shapes import box, cylinder, grid, joined

from geometry.devices import PinholeModel
from geometry.mesh.mesh import TriangleMesh
from geometry.poses import look_at
from geometry.shapes.primitives import sphere
from planning.cameras.camera_cover import camera_candidate_views, plan_cameras
from planning.cameras.proved_cameras import bound_stage, camera_stage
from planning.model.devices.bodies import Existing
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.devices.planned import PlannedCamera, PlannedProjector
from planning.model.document.certificates import (
    BestArea,
    CandidateBound,
    Certificate,
    ContinuousProof,
    CountArea,
    NeededCount,
    OneFewer,
)
from planning.proofs import all_poses, camera_bound
from planning.proofs.camera_bound import DEFAULT, PROVE, bound_cameras, camera_trees
from planning.proofs.cells import crossings
from planning.proofs.cells.image_cone import image_cone
from planning.proofs.cells.measurable_cells import MeasurableCells
from planning.rig.rig import load_rig
from planning.scene.codes.surfaces import CodeSurfaces
from planning.scene.draws import Draw
from planning.scene.lights import ring_frame
from planning.scene.limits import pair_limits
from planning.scene.measuring.measured import LitSamples, lit_samples
from planning.scene.samples import LightOnSamples
from planning.scene.workspace.candidates import aimed_poses
from solvers.cells.cell_bound import CellStatus

EFFORT = all_poses.Effort(finest=6, aims=4, maps=5, budget=1e9, shadows=np.inf)
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def attack_cameras(benchmark_module):
    return benchmark_module("bounds.attack_cameras")


def scene_of(mesh, *, existing=(), coverage=None, limits=None, **workspace):
    """The whole surface is the target; `limits` change those of triangulation."""
    rig = load_rig("default")
    required = make_requirements(mesh, rig, max_projectors=9, coverage=coverage)
    limits = dict(limits or {})
    incidence = limits.pop("max_incidence", required.camera.max_incidence)
    finest = limits.pop("max_sample_distance_m", None)
    required = replace(
        required,
        camera=replace(
            required.camera, max_incidence=incidence, max_sample_distance_m=finest
        ),
        triangulation=replace(required.triangulation, **limits),
        workspace=replace(required.workspace, **workspace),
        existing=tuple(existing),
    )
    return make_scene(mesh, required)


def projectors_at(*positions):
    device, found = load_rig("default").projector_device(), []
    for k, position in enumerate(positions):
        pose = aimed_poses(np.array([position]), np.zeros(3), UP, device)[0]
        ring = ring_frame(pose, device, 0.14, 1.0 + 2.0 * k)
        radii = np.linspace(0.002, 0.4, 200)
        found.append(PlannedProjector("", "diverging", pose, ring, device, radii))
    return tuple(found)


def lens(focal_px=3478.0, distortion=(0.0,) * 5):
    matrix = np.array([[focal_px, 0, 1023.5], [0, 1.02 * focal_px, 760.0], [0, 0, 1]])
    return PinholeModel(matrix, (2048, 1536), (0.9, 1.6), distortion)


def everything_lit(scene, n):
    """Rows on which neither light nor rings forbid anything."""
    target = scene.target_samples(Draw(n, 3))
    normals, one = target.samples.normals, np.ones(n)
    across = np.cross(normals, [0.3, 0.5, 0.8])
    across /= np.linalg.norm(across, axis=1)[:, None]
    light = LightOnSamples(one, 0.0 * one, np.zeros((n, 3)))
    lit = np.ones((n, 1), dtype=bool)
    return LitSamples(
        target,
        lit,
        (light,),
        (CodeSurfaces(*[one] * 4, across, 0.01 * one, np.zeros((len(one), 3))),),
        ("",),
    )


FREE = {"min_conditioning": 0.0, "max_sigma_m": None, "min_ring_pitch_px": None}


def bounded(scene, share, count, *, n=300, effort=EFFORT, device=None):
    rows = everything_lit(scene, n)
    required = int(np.ceil(share * n - 1e-9))
    question = all_poses.BoundQuestion(required, count, n, rows.target.samples.weight)
    return bound_cameras(scene, (device or lens(),), rows, question, effort)


def test_shadows_are_drawn_only_where_the_first_search_leaves_a_doubt(monkeypatch):
    """One camera sees less than half of a ball: two are proved without any shadow."""
    drawn = []
    shadow_maps = camera_bound._shadow_maps

    def noted(*given):
        drawn.append(given)
        return shadow_maps(*given)

    monkeypatch.setattr(camera_bound, "_shadow_maps", noted)
    ball = scene_of(sphere(0.1, subdivisions=3), limits=dict(FREE))
    assert bounded(ball, 0.6, 2).found.status is CellStatus.PROVED
    assert not drawn
    assert bounded(ball, 0.6, 4).found.status is not CellStatus.PROVED
    assert len(drawn) == 1


# ---- under attack

PLATES = joined(
    grid(0.2, 0.2, divisions=(3, 3)),
    TriangleMesh(
        box((0.05, 0.04, 0.03)).vertices + [0, 0, 0.05], box((0.05, 0.04, 0.03)).faces
    ),
)
TIGHT = {
    "min_conditioning": 0.25,
    "max_sigma_m": 1.4e-4,
    "min_ring_pitch_px": 9.0,
    "max_sample_distance_m": 6e-4,
}
LOOSER = TIGHT | {"max_sigma_m": 2e-4, "min_ring_pitch_px": 6.0}
LENSES = {
    "plain": lens(),
    "long": lens(14000.0),
    "bent": lens(3478.0, (-0.2, 0.1, 0.004, -0.003, 0.05)),
}


def shown(mesh, device, limits):
    scene = scene_of(mesh, limits=limits)
    projectors = projectors_at((0.3, -1.0, 0.4), (-0.6, 0.2, 0.9))
    rows = lit_samples(scene, projectors, scene.target_samples(Draw(250, 5)))
    return scene, projectors, rows


@pytest.mark.long
@pytest.mark.parametrize(
    ("mesh", "name"),
    [
        (sphere(0.1, subdivisions=3), "plain"),
        (PLATES, "plain"),
        (PLATES, "long"),
        (PLATES, "bent"),
    ],
)
def test_no_pose_measures_what_its_cells_lack(mesh, name, attack_cameras):
    device = LENSES[name]
    tight = LOOSER if name != "long" else TIGHT | {"max_sample_distance_m": 1.4e-4}
    scene, projectors, rows = shown(mesh, device, tight)
    levels = (7, 6) if name == "long" else (7, 4)
    trees = attack_cameras.trees_of(scene, device, rows, *levels)
    assert ("by aim" in trees) == (name == "long")
    assert "among shadows" in trees
    for tree in trees.values():
        tally = attack_cameras.attack(scene, device, rows, projectors, tree, 150)
        assert tally.violations == ()
        assert tally.lit > 150
        assert tally.depth >= 5


@pytest.mark.parametrize("name", ["without shadows", "by aim"])
def test_a_cell_with_a_sample_too_few_is_caught(name, attack_cameras):
    device = LENSES["long"]
    scene, projectors, rows = shown(PLATES, device, {})
    tree = attack_cameras.trees_of(scene, device, rows, 4, 4)[name]
    space, own = scene.requirements.workspace, None
    sight = attack_cameras.OwnSight(scene, rows, projectors)
    rng = np.random.default_rng((0, 100))
    for pose in attack_cameras.random_poses(space, device, rows, 100, rng):
        measured = sorted(sight.measured(device, pose))
        if len(measured) > 9:
            key = attack_cameras.keys_of(space, device, pose[None])
            own = (key, measured[7])
            break
    key, sample = own
    cell, batch = None, tree.roots()
    while batch.cells.size:
        names = batch.cells[None]
        held = attack_cameras.attack_cells.lies_in(tree, names, key[:, None])[0]
        cell = int(batch.cells[np.flatnonzero(held)[0]])
        batch = tree.children(np.array([cell]))
    bits = tree._rows.values[cell].view(np.uint8)
    assert bits[sample // 8] >> (7 - sample % 8) & 1
    bits[sample // 8] &= ~np.uint8(1 << (7 - sample % 8))
    caught = attack_cameras.attack(scene, device, rows, projectors, tree, 100)
    assert (tuple(key[0].tolist()), sample) in caught.violations
    assert {s for _, s in caught.violations} == {sample}


@pytest.mark.parametrize(
    ("limit", "value", "errors"),
    [
        *[(limit, value, None) for limit, value in TIGHT.items()],
        ("max_sigma_m", 2e-4, CalibrationErrors(angle=3e-4)),
        ("max_sigma_m", 2e-4, CalibrationErrors(position_m=3e-4)),
    ],
)
def test_seen_as_a_point_each_limit_forbids_what_misses_it_by_a_fifth(
    limit, value, errors
):
    """Within 0.1 degrees little is left to chance but where in the image a sample is.

    That costs cos^2 of the corner, 0.87, in the size of a ring on the sensor.
    """
    loose = FREE | {limit: value, "calibration": errors}
    device = LENSES["plain"]
    scene, _, rows = shown(sphere(0.1, subdivisions=3), device, loose)
    samples = rows.target.samples
    worse = loose | {limit: value * (1.2 if limit.startswith("min") else 0.8)}
    stricter = scene_of(scene.mesh, limits=worse)
    position = np.array([0.5, -0.8, 0.55])
    towards = position - samples.points
    distance = np.linalg.norm(towards, axis=1)
    towards /= distance[:, None]
    every, psi = np.arange(len(distance)), np.full(len(distance), 0.0017)
    kept = [
        MeasurableCells(rows, s.requirements, (device,)).admits(
            every, towards, distance - 1e-3, psi
        )
        for s in (scene, stricter)
    ]
    eye = _exact(rows, position, device, scene.requirements)
    assert np.all(kept[0][eye])
    assert not np.any(kept[1] & ~eye)
    assert 0 < np.count_nonzero(eye) < np.count_nonzero(_facing(towards, samples))


def test_of_several_models_what_any_may_measure_is_admitted():
    """No more than each admits alone, and no less."""
    one = LENSES["plain"]
    matrix = one.camera_matrix.copy()
    matrix[[0, 1], [0, 1]] *= 0.4
    other = PinholeModel(matrix, one.resolution, one.range_m)
    loose = FREE | {"min_ring_pitch_px": TIGHT["min_ring_pitch_px"]}
    scene, _, rows = shown(sphere(0.1, subdivisions=3), one, loose)
    towards = np.array([0.5, -0.8, 0.55]) - rows.target.samples.points
    distance = np.linalg.norm(towards, axis=1)
    every, psi = np.arange(len(distance)), np.full(len(distance), 0.05)
    by_one, by_other, by_both = (
        MeasurableCells(rows, scene.requirements, devices).admits(
            every, towards / distance[:, None], distance - 0.02, psi
        )
        for devices in ((one,), (other,), (other, one))
    )
    assert np.any(by_one & ~by_other)
    assert np.array_equal(by_both, by_one | by_other)


def test_over_a_cone_the_largest_cosine_and_the_least_sine_to_a_line():
    """cos(max(0, a - psi)) of a direction at a, and sin(max(0, a - psi)) to a line."""
    a = np.radians(np.linspace(0.0, 180.0, 61))[:, None]
    psi = np.radians(np.linspace(0.0, 180.0, 61))[None, :]
    cone = crossings.Cone(a, psi, np.cos(psi), np.sin(psi))
    nearest = crossings.nearest_cos(np.cos(a), cone)
    np.testing.assert_allclose(nearest, np.cos(np.maximum(a - psi, 0)), atol=1e-7)
    line = np.arccos(np.abs(np.cos(a)))
    sine = crossings._least_sine(np.cos(line), cone)
    np.testing.assert_allclose(sine, np.sin(np.maximum(line - psi, 0)), atol=1e-7)


def _turned_by(axes, angles, rng):
    """Return unit vectors at angles from axes, at random azimuths."""
    aside = np.cross(axes, rng.normal(size=axes.shape))
    aside /= np.linalg.norm(aside, axis=-1, keepdims=True)
    return np.cos(angles)[..., None] * axes + np.sin(angles)[..., None] * aside


def _rotations(source, target, rng):
    """Return rotations that take unit vectors to others, with random spin."""
    frames = []
    for axes in (source, target):
        x = _turned_by(axes, np.full(axes.shape[:-1], np.pi / 2), rng)
        frames.append(np.stack([axes, x, np.cross(axes, x)], axis=-1))
    return frames[1] @ np.swapaxes(frames[0], -1, -2)


# What each error by itself takes from the accuracy, and all of them from half of it.
OFF = [
    CalibrationErrors(angle=2e-4),
    CalibrationErrors(position_m=2e-4),
    CalibrationErrors(focal=1e-4),
    CalibrationErrors(principal_px=0.6),
    CalibrationErrors(1e-4, 1e-4, 5e-5, 0.2),
]


@pytest.mark.parametrize("name", ["plain", "bent"])
@pytest.mark.parametrize(
    ("limit", "value", "off"),
    [
        *[(name, value, None) for name, value in TIGHT.items()],
        ("min_ring_pitch_px", 40.0, None),
        *[("max_sigma_m", 3e-4, errors) for errors in OFF],
    ],
)
def test_what_any_place_and_aim_measures_is_admitted(limit, value, off, name):
    """Each limit alone, for cells of up to 20 degrees; light and rings at random.

    Rings 40 px apart in the image are those seen along the ring: pitch has no bound.
    """
    errors = off or CalibrationErrors()
    device, rng, n, tries = LENSES[name], np.random.default_rng(7), 200, 300
    rows = everything_lit(scene_of(sphere(0.1, subdivisions=3)), n)
    m = rng.normal(size=(n, 3))
    m /= np.linalg.norm(m, axis=1)[:, None]
    spacing, cosine = rng.uniform(1e-3, 6e-3, n), rng.uniform(0.5, 1.0, n)
    light = replace(rows.lights[0], incidence_cos=cosine)
    levers = rng.uniform([0.0, 0.0, 0.0], [1.5, 0.6, 1e-3], (n, 3))
    rows = replace(
        rows,
        lights=(light,),
        surfaces=(CodeSurfaces(*[cosine] * 4, m, spacing, levers),),
    )
    limits = FREE | {limit: value, "calibration": off}
    required = scene_of(sphere(0.1), limits=limits).requirements
    normals = rows.target.samples.normals
    towards = _turned_by(normals, np.radians(rng.uniform(0, 85, n)), rng)
    psi, far = rng.uniform(0.0, 0.35, n), rng.uniform(0.95, 1.4, n)
    nearest = far - rng.uniform(0.0, 0.2, n)
    cells = MeasurableCells(rows, required, (device,))
    admitted = cells.admits(np.arange(n), towards, nearest, psi)
    # Places in each cell, and pixels in which the sample appears from there.
    lean = psi[:, None] * rng.choice([0.0, 0.5, 1.0], (n, tries))
    u = _turned_by(np.repeat(towards[:, None], tries, axis=1), lean, rng)
    t = nearest[:, None] + (far - nearest)[:, None] * rng.integers(0, 2, (n, tries))
    pixel = rng.uniform(-0.5, 1.0, (n, tries, 2)).clip(0, 1) * [2047.0, 1535.0]
    local = device.rays(pixel)
    turn = _rotations(local, -u, rng)
    jacobian = turn @ device.ray_jacobian(local.reshape(-1, 3)).reshape(n, tries, 3, 2)
    facing = np.einsum("ij,ikj->ik", normals, u)
    along = np.abs(np.einsum("ij,ikj->ik", m, u))
    v = np.cross(-u, np.cross(normals, m)[:, None])
    turned = np.einsum("ikab,ika->ikb", jacobian, v)
    g = np.linalg.norm(turned, axis=2)
    # Variances of v.dX and m.dY: a third of a turn's square, half of a shift's.
    longer = (turned * (pixel - device.camera_matrix[:2, 2])).sum(axis=2)
    ray = (errors.angle**2 * t**2 + errors.position_m**2) / 3.0 * (v**2).sum(axis=2)
    ray += t**2 * (errors.focal * longer) ** 2
    ray += t**2 * (errors.principal_px * g) ** 2 / 2.0
    by_turn, by_scale, by_shift = np.square(levers.T)
    surface = errors.angle**2 * by_turn / 3.0 + errors.position_m**2 / 3.0
    surface += errors.focal**2 * by_scale + errors.principal_px**2 * by_shift / 2.0
    edges = (0.1 / cosine[:, None] * t * g) ** 2
    sigma = np.sqrt(edges + ray + surface[:, None] * facing**2)
    with np.errstate(divide="ignore"):
        good = {
            "min_conditioning": along >= value,
            "max_sigma_m": sigma / along <= value,
            "min_ring_pitch_px": spacing[:, None] * facing >= value * t * g,
            "max_sample_distance_m": t * local[:, :, 2]
            <= value * device.focal_px * facing,
        }[limit]
    measured = (good & (facing >= np.cos(np.radians(70.0)))).any(axis=1)
    assert not np.any(measured & ~admitted)
    assert np.count_nonzero(measured) > 5
    # It does forbid; of a lens model that folds back, little is known.
    assert np.count_nonzero(admitted) < (0.97 if name == "plain" else 1.0) * n


def _facing(towards, samples):
    return np.einsum("ij,ij->i", towards, samples.normals) >= np.cos(np.radians(70.0))


def _exact(rows, position, device, required):
    """What a camera that looks at the centre measures, but for shadows."""
    from planning.scene.measuring import measurability

    camera = PlannedCamera("", look_at(position, np.zeros(3), UP), device)
    seen = measurability.view(camera, rows.target, required.camera, None)
    every = np.zeros(len(seen.first_violated), dtype=bool)
    for p, (light, rings) in enumerate(zip(rows.lights, rows.surfaces, strict=True)):
        quality = measurability.pair_quality(
            rows.target.samples.normals, light, rings, seen, required.triangulation
        )
        passed = measurability.first_pair_failure(quality, required.triangulation)
        every |= rows.lit[:, p] & (passed == pair_limits.MEASURED)
    return every & (seen.seen)


# ---- what holds for a whole image


@pytest.mark.parametrize(
    "distortion",
    [
        (0.0, 0.0, 0.0, 0.0, 0.0),
        (-0.3, 0.15, 0.002, -0.004, 0.0),
        (-0.6, 0.0, 0.0, 0.0, 0.0),
        (0.2, 0.0, 0.0, 0.0, -0.05),
    ],
)
def test_no_point_in_the_image_leaves_the_cone_or_turns_less(distortion):
    """Points up to 80 degrees off, also those beyond where the lens model folds."""
    device = lens(1500.0, distortion)
    cone = image_cone(device)
    rng = np.random.default_rng(4)
    off, turn = np.radians(rng.uniform(0, 80, 20000)), rng.uniform(0, 2 * np.pi, 20000)
    rays = np.column_stack(
        [np.sin(off) * np.cos(turn), np.sin(off) * np.sin(turn), np.cos(off)]
    )
    inside = device.contains(device.project(rays))
    rays, off = rays[inside], off[inside]
    assert len(rays) > 1000
    along = np.arccos(np.clip(rays @ cone.axis, -1, 1))
    assert np.all(along <= cone.half_angle)
    assert np.all(off <= cone.off_axis + 1e-9)
    across = np.cross(rays, rng.normal(size=rays.shape))
    across /= np.linalg.norm(across, axis=1)[:, None]
    g = np.einsum("nji,nj->ni", device.ray_jacobian(rays), across)
    turned = np.linalg.norm(g, axis=1)
    assert np.all(turned >= cone.least_turn)
    if not any(distortion):
        # It is no wider than it has to be.
        assert along.max() > 0.98 * cone.half_angle
        assert turned.min() < 1.1 * cone.least_turn


def test_a_lens_model_that_never_leaves_the_image_is_bounded_by_its_fold():
    """Tangential terms alone may cancel the rest at any distance."""
    device = lens(1500.0, (0.0, 0.0, 0.01, 0.0, 0.0))
    assert image_cone(device).off_axis == np.arctan(device.fold)


# ---- counts of closed form


@pytest.mark.long
@pytest.mark.parametrize("degrees", [70.0, 50.0, 40.0])
def test_a_ring_of_cameras_about_a_cylinder_is_that_of_the_closed_form(degrees):
    """eta = theta - asin(rho/S sin theta), n_min = floor(pi / eta) + 1."""
    tube = cylinder(0.1, 0.02, around=192, along=1, capped=False)
    theta = np.radians(degrees)
    limits = FREE | {"max_incidence": theta}
    scene = scene_of(tube, limits=limits, camera_radius_m=(1.0, 1.0))
    count = round_body_limit(0.1, 1.0, theta).n_min
    open_air = replace(EFFORT, shadows=0.0)
    assert bounded(scene, 1.0, count, effort=open_air).found.lower_bound == count
    more = bounded(scene, 1.0, count + 1, effort=open_air).found
    assert more.lower_bound <= count


@pytest.mark.parametrize(("share", "count"), [(0.19, 1), (0.4, 2), (0.6, 3)])
def test_a_sphere_takes_as_many_cameras_as_its_caps_hold(share, count):
    """A camera at 1 m meets a cap of eta = 60 - asin(0.1 sin 60) = 55 degrees, 0.213.

    At 1.2 m it is 0.218.
    """
    ball = sphere(0.1, subdivisions=4)
    limits = FREE | {"max_incidence": np.radians(60.0)}
    scene = scene_of(ball, limits=limits, camera_radius_m=(1.0, 1.2))
    found = bounded(scene, share, count, n=500)
    assert found.found.lower_bound == count
    assert found.found.status is CellStatus.PROVED
    # What was proved without shadows holds with them.
    assert found.shadows


def test_a_plate_takes_one_camera_and_two_if_its_image_doesnt_hold_it():
    """0.5 m of plate, a field of 2 beta = 6.6 degrees, incidence up to 30 degrees.

    At distance t <= 1.2 m across the cone reaches over 2 t tan beta / cos^2 30 or
    less, 0.18 m and a bit: one image holds no 95 % of the plate. Without the field one
    camera is enough.
    """
    wall = grid(0.5, 0.02, divisions=(10, 1))
    limits = FREE | {"max_incidence": np.radians(30.0)}
    radius = {"camera_radius_m": (1.1, 1.2)}
    scene = scene_of(wall, limits=limits, **radius)
    effort = replace(EFFORT, shadows=0.0)
    wide = bounded(scene, 0.95, 1, effort=effort, device=lens(2000.0))
    assert wide.found.lower_bound == 1
    narrow = lens(22000.0)
    assert image_cone(narrow).half_angle == pytest.approx(np.radians(3.3), rel=0.02)
    found = bounded(scene, 0.95, 2, effort=effort, device=narrow)
    assert found.found.lower_bound == 2
    blind = replace(effort, aims=None)
    assert bounded(scene, 0.95, 2, effort=blind, device=narrow).found.lower_bound == 1


def test_shadows_are_counted_where_they_decide():
    """Two plates that face each other, 60 mm apart, seen on their inner sides.

    One camera sees much of one and none of the other; without shadows all of it.
    """
    plate = grid(0.1, 0.1, divisions=(6, 6))
    other = TriangleMesh(plate.vertices + [0, 0, 0.02], plate.faces[:, ::-1])
    scene = scene_of(joined(plate, other), limits=FREE)
    seen = bounded(scene, 0.45, 2).found
    assert seen.lower_bound == 2
    blind = bounded(scene, 0.45, 2, effort=replace(EFFORT, shadows=0.0))
    assert blind.found.lower_bound == 1
    assert not blind.shadows


def test_cameras_inside_the_object_cast_no_shadows_that_are_relied_on():
    """Where the shell cuts the object, something may stand behind the camera."""
    for radius, counted in ((0.05, False), (0.9, True)):
        scene = scene_of(PLATES, limits=FREE, camera_radius_m=(radius, 1.2))
        trees = camera_trees(scene, (lens(),), everything_lit(scene, 50), EFFORT)
        assert any(shadows for _, shadows in trees) == counted
        found = bounded(scene, 0.45, 3, n=50, effort=replace(EFFORT, finest=3))
        assert found.shadows == (counted or found.found.status is CellStatus.PROVED)


# ---- in a certificate


def standing(name, position):
    pose = look_at(np.array(position), np.zeros(3), UP)
    return Existing(name, "camera", tuple(tuple(row) for row in pose.tolist()))


def staged(existing=()):
    limits = {"min_ring_pitch_px": None}
    ball = sphere(0.1, subdivisions=3)
    scene = scene_of(ball, existing=existing, coverage=0.97, limits=limits)
    projectors = projectors_at((0.3, -1.0, 0.4), (-0.6, 0.2, 0.9))
    camera = PlannedCamera("", np.eye(4), load_rig("default").camera_device())
    cover = plan_cameras(
        scene, projectors, camera_candidate_views(scene, (camera,), 200)
    )
    return scene, camera_stage(scene, cover)


@pytest.mark.parametrize("given", [0, 1])
def test_a_certificate_says_what_holds_over_all_poses(given):
    """One that stands already is in every plan; what it measures is free."""
    existing = [standing("old", (0.0, 1.1, 0.0))][:given]
    scene, stage = staged(existing)
    assert stage.certificate.continuous is None
    device = load_rig("default").camera_device()
    found = bound_stage(scene, stage, (device,), replace(EFFORT, finest=7))
    proof = found.certificate.to_document()
    entry, needed = proof["continuous"], proof["needed"]
    assert given < entry["lower_bound"] <= needed["count"]
    assert entry["lower_bound"] >= needed["count"] - 1
    proved = entry["lower_bound"] == needed["count"]
    assert entry["status"] == ("proved" if proved else "survived")
    assert entry["n_samples"] == proof["n_samples"] == len(stage.cover.samples.target)
    assert entry["n_reached"] == np.count_nonzero(stage.cover.measured.any(axis=1))
    # No candidates do better than poses anywhere.
    values = {row["count"]: row["value_m2"] for row in proof["by_count"]}
    assert entry["one_fewer_upper_bound_m2"] >= values.get(needed["count"] - 1, 0.0)
    free = stage.cover.measured[:, :given].any(axis=1).sum() if given else 0
    assert entry["n_cells"] > 0
    assert (
        entry["one_fewer_upper_bound_m2"]
        >= free * stage.cover.samples.target.samples.weight
    )


def test_cameras_that_stand_already_and_are_enough_need_no_cells():
    views = [(0.3, -1.0, 0.4), (-0.9, 0.2, 0.6), (0.3, 0.3, 1.0), (0.9, -0.6, 0.1)]
    views += [(-0.6, -0.8, 0.5), (-0.4, 0.9, 0.4), (0.5, -0.4, -0.9), (0.0, 0.0, -1.1)]
    existing = [
        standing(f"old {k}", 1.1 * np.array(v) / np.linalg.norm(v))
        for k, v in enumerate(views)
    ]
    scene, stage = staged(existing)
    device = load_rig("default").camera_device()
    proof = bound_stage(scene, stage, (device,), EFFORT).certificate.continuous
    assert (proof.lower_bound, proof.n_cells) == (len(existing), 0)


def test_a_bound_over_all_poses_raises_that_over_candidates_and_lowers_areas():
    proof = Certificate(
        count=3,
        status="feasible",
        required_m2=1.0,
        n_samples=100,
        candidates=CandidateBound(lower_bound=2, n_candidates=9, proof="before"),
        continuous=None,
        greedy_count=3,
        needed=NeededCount(count=3, lower_bound=2),
        by_count=[
            CountArea(count=1, value_m2=1.0, upper_bound_m2=2.0),
            CountArea(count=2, value_m2=2.0, upper_bound_m2=3.0),
            CountArea(count=3, value_m2=3.0, upper_bound_m2=3.0),
        ],
        best_area=BestArea(value_m2=3.0, upper_bound_m2=3.0),
        one_fewer=OneFewer(upper_bound_m2=3.0),
    )
    bound = ContinuousProof(
        lower_bound=3,
        status="proved",
        proof="cells",
        occlusion=True,
        n_samples=100,
        n_reached=90,
        n_cells=5,
        one_fewer_upper_bound_m2=2.5,
    )
    raised = all_poses.joined(proof, bound)
    assert raised.needed.lower_bound == 3
    assert raised.candidates.lower_bound == 3
    assert raised.status == "optimal"
    assert raised.one_fewer.upper_bound_m2 == 2.5
    assert [row.upper_bound_m2 for row in raised.by_count] == [2.0, 2.5, 3.0]
    assert raised.best_area.upper_bound_m2 == 3.0
    # Fewer are allowed than are needed: their best area is bounded as well.
    short = all_poses.joined(proof.changed(count=2, status="infeasible"), bound)
    assert short.best_area.upper_bound_m2 == 2.5
    assert (short.status, short.candidates.lower_bound) == ("infeasible", 2)
    # The total alone takes three where two cover less than it.
    floored = proof.changed(
        required_m2=2.7, candidates=proof.candidates.changed(for_total=2)
    )
    assert all_poses.joined(floored, bound).candidates.for_total == 3
    # What speaks of other samples stays beside it.
    apart = all_poses.joined(proof, bound.changed(n_samples=90))
    assert apart.needed.lower_bound == 2
    assert apart.by_count == proof.by_count


def test_more_is_spent_where_a_proof_is_asked_for():
    assert PROVE.finest > DEFAULT.finest
    assert PROVE.budget > DEFAULT.budget
    assert PROVE.aims is not None
    assert DEFAULT.aims is None
