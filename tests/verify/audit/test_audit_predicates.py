"""The audit's predicates against a slow scalar loop and closed forms."""

import ast
import math
from pathlib import Path

import numpy as np
import pytest
from support.plain_shapes import box, grid, joined

from geometry.devices import ParallelModel, PinholeModel
from geometry.mesh.mesh import TriangleMesh
from geometry.poses import look_at
from planning.model.requirements import ProjectorLimits
from planning.verify.audit.audit_samples import AuditSamples, draw_samples
from planning.verify.audit.baselines.audit_seams import are_normals, faces_reach
from planning.verify.audit.predicates.audit_devices import AuditProjector, light_from
from planning.verify.audit.predicates.audit_optics import in_image, pixel_gradient
from planning.verify.audit.predicates.occlusion import Shadow
from planning.verify.audit.predicates.predicates import (
    LIGHT_CAUSES,
    LIT,
    PAIR_CAUSES,
    SIGHT_CAUSES,
    light_steps,
)
from planning.verify.audit.predicates.recompute import recompute

AUDIT = Path(__file__).resolve().parents[3] / "planning" / "verify" / "audit"
FREE_LIMITS = ProjectorLimits(math.radians(89.9), 0.0)


def samples_on(mesh: TriangleMesh, n: int, seed: int = 3) -> AuditSamples:
    rng = np.random.default_rng(seed)
    areas = mesh.face_areas
    faces = rng.choice(len(areas), size=n, p=areas / areas.sum())
    points = np.einsum(
        "nk,nkd->nd", rng.dirichlet((1.0, 1.0, 1.0), size=n), mesh.corners[faces]
    )
    return AuditSamples(
        points,
        mesh.face_normals[faces],
        faces,
        np.zeros((n, 3)),
        np.zeros(n, dtype=np.int64),
        np.ones(n, dtype=bool),
        np.full(n, mesh.area / n),
    )


def moved(mesh: TriangleMesh, shift: tuple[float, float, float], scale: float = 1.0):
    return TriangleMesh(scale * mesh.vertices + np.array(shift), mesh.faces)


@pytest.mark.parametrize("light", ["diverging", "parallel"])
def test_every_limit_agrees_with_the_scalar_loop_point_by_point(handmade, light):
    plan = handmade.build_plan(light)
    document = plan.to_document()
    samples = draw_samples(plan.surface, "dominant", 1500, seed=9)
    own = recompute(plan, samples, Shadow(plan.surface.mesh, threads=1))
    limits = document["requirements"]
    reached: set[str] = set()
    wrong = 0
    for i in range(len(samples)):
        p, n = samples.points[i].tolist(), samples.normals[i].tolist()
        steep = samples.steep[i].tolist()
        for j, projector in enumerate(document["projectors"]):
            steps = handmade.light_steps(projector, p, n, steep, limits["projector"])
            wrong += steps != own.light[j, i]
            if steps < LIT:
                reached.add(LIGHT_CAUSES[steps])
                assert own.pairs[j, :, i].tolist() == [-1, -1]
                continue
            margin = handmade.margin(projector, p, n, steep, limits["projector"])
            assert own.margins[j, i] == pytest.approx(margin, abs=1e-9)
            for k, camera in enumerate(document["cameras"]):
                steps = handmade.pair_steps(projector, camera, p, n, limits)
                wrong += steps != own.pairs[j, k, i]
                reached.add((*SIGHT_CAUSES, *PAIR_CAUSES, "measured")[steps])
    # A decision may differ only where a quantity equals its limit to rounding.
    assert wrong <= 2
    expected = {"projector_range", "projector_incidence", "tangent_angle", "measured"}
    assert expected | {"conditioning", "sigma", "sample_distance"} <= reached


def test_pixel_gradient_is_the_transposed_ray_derivative():
    device = PinholeModel(
        np.array([[1400.0, 0, 640], [0, 1390.0, 500], [0, 0, 1]]),
        (1280, 1024),
        (0.1, 9.0),
        (-0.25, 0.08, 0.002, -0.003, 0.01),
    )
    pixels = np.array([[640.0, 500.0], [100.0, 80.0], [1200.0, 950.0]])

    def rays(at):
        goal = (at - [640.0, 500.0]) / [1400.0, 1390.0]
        p = goal.copy()
        for _ in range(200):
            s = (p * p).sum(axis=1, keepdims=True)
            radial = 1 - 0.25 * s + 0.08 * s**2 + 0.01 * s**3
            xy = p[:, :1] * p[:, 1:]
            bend = np.hstack(
                [
                    2 * 0.002 * xy - 0.003 * (s + 2 * p[:, :1] ** 2),
                    0.002 * (s + 2 * p[:, 1:] ** 2) + 2 * -0.003 * xy,
                ]
            )
            p = (goal - bend) / radial
        r = np.hstack([p, np.ones((len(p), 1))])
        return r / np.linalg.norm(r, axis=1, keepdims=True)

    r = rays(pixels)
    across = np.cross(r, [[0.3, -0.2, 0.9]])
    slope = [(rays(pixels + d) - rays(pixels - d)) / 2 for d in ([1.0, 0], [0, 1.0])]
    expected = np.column_stack([(s * across).sum(axis=1) for s in slope])
    found = pixel_gradient(device, 0.7 * r, across)
    np.testing.assert_allclose(found, expected, rtol=1e-5)


def test_ring_gradient_is_the_slope_of_the_ring_coordinate():
    points = np.array([[0.1, -0.2, 0.9], [-0.03, 0.01, 1.2]])
    for device in (
        PinholeModel(np.eye(3), (4, 3), (0.1, 2.0)),
        ParallelModel((4, 3), 1e-3, (0.0, 2.0)),
    ):
        light = light_from(device, np.eye(4))
        after, before = (
            np.column_stack([light.coordinate(points + step) for step in steps])
            for steps in (1e-6 * np.eye(3), -1e-6 * np.eye(3))
        )
        numeric = (after - before) / 2e-6
        np.testing.assert_allclose(light.gradient(points), numeric, atol=1e-8)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (40.0, -70.0, 25.0)])
def test_parallel_shadow_of_a_plate_is_its_outline_at_any_scale(scale, shift):
    floor = grid(0.2, 0.2, divisions=(8, 8))
    plate = moved(grid(0.08, 0.05, divisions=(2, 2)), (0.02, 0.01, 0.04))
    mesh = moved(joined(floor, plate), tuple(scale * x for x in shift), scale)
    samples = samples_on(mesh, 4000)
    lamp = AuditProjector(
        ParallelModel((1000, 1000), 1e-3 * scale, (0.0, 5.0 * scale)),
        pose := look_at(
            scale * np.add(shift, (0.0, 0.0, 1.0)),
            scale * np.array(shift),
            up=np.array([0.0, 1.0, 0.0]),
        ),
        pose,
        np.array([1.0, 2.0]) * scale,
    )
    lit = light_steps(lamp, samples, FREE_LIMITS, Shadow(mesh, threads=1)) == LIT
    local = samples.points / scale - shift
    on_floor = local[:, 2] < 0.02
    shadow = (np.abs(local[:, 0] - 0.02) < 0.04) & (np.abs(local[:, 1] - 0.01) < 0.025)
    assert np.array_equal(lit, ~(on_floor & shadow))


@pytest.mark.parametrize("distance", [0.3, 2.0, 500.0])
def test_diverging_light_meets_exactly_the_faces_of_a_box_that_face_it(distance):
    mesh = box((0.1, 0.08, 0.06), divisions=5)
    samples = samples_on(mesh, 4000)
    at = distance * np.array([0.5, 0.3, 0.8])
    pose = look_at(at, np.zeros(3), up=np.array([0.0, 0.0, 1.0]))
    lamp = AuditProjector(
        PinholeModel(
            np.array([[300.0, 0, 500], [0, 300.0, 500], [0, 0, 1]]),
            (1001, 1001),
            (0, 1e4),
        ),
        pose,
        pose,
        np.array([1.0, 9.0]),
    )
    lit = light_steps(lamp, samples, FREE_LIMITS, Shadow(mesh, threads=2)) == LIT
    facing = ((at - samples.points) * samples.normals).sum(axis=1) > 0
    assert np.array_equal(lit, facing)
    assert 0.3 < lit.mean() < 0.7


def test_a_point_source_casts_a_magnified_shadow():
    floor = grid(0.3, 0.3, divisions=(4, 4))
    plate = moved(grid(0.05, 0.05, divisions=(1, 1)), (0.0, 0.0, 0.25))
    mesh = joined(floor, plate)
    samples = samples_on(mesh, 4000)
    pose = look_at(np.array([0, 0, 0.5]), np.zeros(3), up=np.array([0.0, 1.0, 0.0]))
    lamp = AuditProjector(
        PinholeModel(
            np.array([[100.0, 0, 99.5], [0, 100.0, 99.5], [0, 0, 1]]),
            (200, 200),
            (0, 2),
        ),
        pose,
        pose,
        np.array([1.0, 9.0]),
    )
    lit = light_steps(lamp, samples, FREE_LIMITS, Shadow(mesh, threads=1)) == LIT
    # Half way between source and floor the plate's shadow is twice as wide as it is.
    shadow = np.all(np.abs(samples.points[:, :2]) < 0.05, axis=1)
    assert np.array_equal(lit, (samples.points[:, 2] > 0.1) | ~shadow)


def test_draws_are_uniform_and_split_between_target_and_rest(handmade):
    surface = handmade.build_plan().surface
    samples = draw_samples(surface, "dominant", 20_000, seed=0)
    assert samples.in_target.sum() == 10_000
    assert np.array_equal(samples.in_target, surface.region[samples.faces] >= 0)
    assert samples.weights.sum() == pytest.approx(surface.mesh.area)
    # The mean of z over a spherical cap is the mean of its bounds (Archimedes).
    z = samples.points[samples.in_target, 2]
    heights = surface.mesh.face_centroids[surface.in_dominant, 2]
    areas = surface.mesh.face_areas[surface.in_dominant]
    assert z.mean() == pytest.approx(np.average(heights, weights=areas), abs=5e-4)
    plane = surface.mesh.corners[samples.faces, 0]
    off = ((samples.points - plane) * samples.normals).sum(axis=1)
    assert np.abs(off).max() < 1e-15


def test_the_audit_imports_nothing_of_the_planner():
    allowed = {
        "planning.model.document.device_records",
        "planning.model.document.certificates",
        "planning.model.document.check_records",
        "planning.model.document.part",
        "planning.model.document.plan_document",
        "planning.model.document.coverage_records",
        "planning.model.document.input_records",
        "planning.model.document.request_records",
        "planning.model.document.ring_records",
        "planning.model.document.head_records",
        "planning.model.document.joint_records",
        "planning.model.document.station_records",
        "planning.model.document.survival_records",
        "planning.model.light.dense_code",
        "planning.model.light.drawn_edges",
        "planning.model.light.light_budget",
        "planning.model.devices.bodies",
        "planning.model.devices.planned",
        "planning.model.plan",
        "planning.model.proofs",
        "planning.model.requirements",
        "planning.model.surface",
        "planning.model.devices.calibration_errors",
        "planning.model.errors",
        "planning.model.files",
        "geometry.mesh.mesh",
        # The planner's own draws, made again: which samples a bound speaks of.
        "geometry.mesh.sampling",
        "geometry.mesh.topology",
        "geometry.files.readers",
        "geometry.rays.proximity",
        "geometry.rays.rays",
        "geometry.arrays",
        "geometry.parallel",
        "geometry.devices",
    }
    for path in AUDIT.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and node.level == 0:
                names = [node.module or ""]
            assert not isinstance(node, ast.ImportFrom) or node.level < 2, path
            ours = {
                n
                for n in names
                if n.split(".")[0] in ("planning", "geometry", "solvers")
                and not n.startswith("planning.verify.audit.")
            }
            assert ours <= allowed, f"{path.name} imports {ours - allowed}"


def test_the_audit_uses_no_method_of_the_device_models():
    text = "\n".join(path.read_text() for path in AUDIT.rglob("*.py"))
    for name in (".project(", ".contains(", ".rays(", ".ray_jacobian(", ".half_panel"):
        assert name not in text


def test_normals_at_a_seam_point_are_those_of_faces_beside_it():
    """At the edge of a box: its other sides aren't, though two of them share its x."""
    solid = box((0.1, 0.06, 0.04), divisions=8)
    (_, near, _), (right, _, _) = solid.bounds
    edge, reach = np.array([right, near, 0.001]), faces_reach(solid)

    def beside(*normal: float) -> bool:
        normals = np.array([[1.0, 0.0, 0.0], normal])
        return are_normals(normals, edge, solid, reach)

    assert beside(0.0, -1.0, 0.0)
    for other in np.vstack([np.eye(3)[1:], -np.eye(3)[::2]]):
        assert not beside(*other)


@pytest.mark.parametrize(
    "terms",
    [
        (-0.35, 0.0, 0.0, 0.0, 0.0),
        (-0.3, 0.05, 0.002, -0.004, 0.0),
        (0.2, 0.0, 0.001, 0.0, -0.05),
        (0.1, 0.05, 0.0, 0.0, 0.0),
    ],
)
def test_rays_beyond_a_fold_are_in_no_image(terms):
    """As the planner has it, which puts some of them back into the image otherwise."""
    matrix = np.array([[1800.0, 0.0, 639.5], [0.0, 1800.0, 511.5], [0.0, 0.0, 1.0]])
    device = PinholeModel(matrix, (1280, 1024), (0.1, 9.0), terms)
    off = np.linspace(-1.5, 1.5, 4001)
    for turn in np.linspace(0.0, 3.0, 7):
        aside = np.outer(np.tan(off), [math.cos(turn), math.sin(turn)])
        local = np.column_stack([aside, np.ones(len(off))])
        inside = in_image(device, local)
        assert np.array_equal(inside, device.in_field(local))
        assert np.abs(np.flatnonzero(np.diff(inside)) - 2000).max() < 1000
        assert len(np.flatnonzero(np.diff(inside))) == 2
