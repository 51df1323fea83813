"""Obstacles: what stands in the light is in the way for planner, audit and pixels."""

from dataclasses import replace
from io import BytesIO
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from support.factories import EXACT
from support.plain_shapes import box as plate_of

from geometry.files.interchange import to_trimesh
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes import primitives
from geometry.shapes.clipping import clipped_to_ball
from planning import RequirementError, load_rig, plan_rig
from planning.model.devices.bodies import Obstacle
from planning.model.errors import InfeasibleLimitsError, PlanFileError, RigError
from planning.model.plan import RigPlan
from planning.model.surface import Surface
from planning.report.drawing.face_colours import face_status
from planning.report.drawing.obstacle_figures import obstacle_figures
from planning.report.drawing.rig_picture import draw_rig
from planning.report.summary.summary import summary
from planning.rig.wishes import Wishes
from planning.scene.placed_bodies import Obstruction
from planning.verify.audit.audit import audit_plan
from planning.verify.reconstruction.render.occluders import obstacles_of

CENTRE = np.array([0.3, -0.2, 0.5])
SMALL = EXACT + (
    "[requirements]\ncoverage = 0.8\ndominant_coverage = 0.8\nmin_reachable = 0.1\n"
    "[placement]\nn_candidate_projectors = 600\nn_reference_projectors = 600\n"
    "n_candidate_cameras = 400\nn_reference_cameras = 400\n"
)
ROBOT = (
    '[[obstacle]]\nname = "robot"\nshape = "box"\ncentre_mm = [60, 0, 150]\n'
    "size_mm = [80, 300, 60]\nturn_deg = [0, 20, 0]\n"
)
POLE = (
    '[[obstacle]]\nname = "pole"\nshape = "cylinder"\ncentre_mm = [-90, 0, 200]\n'
    "radius_mm = 15\nheight_mm = 300\nturn_deg = [90, 0, 0]\n"
)
ARM = (
    '[[obstacle]]\nname = "arm"\nshape = "mesh"\nfile = "arm.stl"\n'
    "centre_mm = [0, 0, 0]\n"
)
# Far below all else, and called like the bench.
GROUND = (
    '[[workspace.keep_out]]\nname = "bench"\nblocks = false\n'
    "centre_mm = [0, 0, -2000]\nsize_mm = [900, 700, 30]\n"
)
BENCH = '[[obstacle]]\nname = "bench"\nshape = "table"\nsize_mm = [900, 700, 30]\n'


@pytest.fixture
def rig_of(tmp_path):
    def build(text, before=""):
        path = tmp_path / "rig.toml"
        path.write_text(f'base = "default"\n{before}{text}', encoding="utf-8")
        return load_rig(path)

    return build


def plate():
    flat = plate_of((0.1, 0.1, 0.01), divisions=4)
    return TriangleMesh(flat.vertices + CENTRE, flat.faces)


def standing(rig, mesh, **wishes):
    asked = Wishes(max_projectors=3, **wishes)
    required = rig.requirements(mesh.centre, mesh.radius, asked, tau_m=0.003)
    return rig.obstacles(required.workspace, mesh)


# ---- where they stand


def test_shapes_stand_where_the_rig_file_puts_them(rig_of, tmp_path):
    part = trimesh.creation.box((20.0, 30.0, 40.0))
    part.apply_translation([0, 0, 20])
    part.export(tmp_path / "clamp.stl")
    clamp = (
        '[[obstacle]]\nname = "clamp"\nshape = "mesh"\nfile = "clamp.stl"\n'
        'unit = "mm"\ncentre_mm = [10, 0, 5]\nturn_deg = [0, 0, 90]\n'
    )
    mesh = plate()
    solids = standing(rig_of(ROBOT + POLE + BENCH + clamp), mesh)
    robot, pole, bench, held = (solid.mesh for solid in solids)
    assert [s.name for s in solids] == ["robot", "pole", "bench", "clamp"]
    assert robot.area == pytest.approx(2 * (0.08 * 0.3 + 0.3 * 0.06 + 0.06 * 0.08))
    middle = mesh.centre + [0.06, 0.0, 0.15]
    assert np.allclose(robot.vertices.mean(axis=0), middle)
    # Turned by 20 degrees about y: the longest side of the profile.
    c, s = np.cos(np.radians(20)), np.sin(np.radians(20))
    assert np.ptp(robot.bounds, axis=0)[0] == pytest.approx(0.08 * c + 0.06 * s)
    # A cylinder along z, turned about x, runs along y.
    assert np.allclose(np.ptp(pole.bounds, axis=0), [0.03, 0.3, 0.03], atol=1e-4)
    # The table's top touches the plate's underside.
    assert bench.bounds[1, 2] == pytest.approx(mesh.bounds[0, 2])
    assert np.allclose(np.ptp(bench.bounds, axis=0), [0.9, 0.7, 0.03])
    assert np.allclose(
        held.bounds - mesh.centre,
        [[0.01 - 0.015, -0.01, 0.005], [0.01 + 0.015, 0.01, 0.045]],
    )


@pytest.mark.parametrize("up", ["x", "y", "z", "-x", "-y", "-z"])
def test_a_table_lies_under_the_object_whatever_is_up(rig_of, up):
    mesh = plate()
    (bench,) = standing(rig_of(BENCH), mesh, up=up)
    axis, sign = "xyz".index(up[-1]), -1.0 if up[0] == "-" else 1.0
    heights = sign * bench.mesh.vertices[:, axis]
    lowest = (sign * mesh.vertices[:, axis]).min()
    assert heights.max() == pytest.approx(lowest)
    assert np.ptp(heights) == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        (
            ROBOT.replace("box", "cone"),
            RigError,
            "'box', 'cylinder', 'table' or 'mesh'",
        ),
        (ROBOT + ROBOT, RigError, "obstacle names 'robot' twice"),
        (ROBOT + "radius_mm = 3\n", RigError, "takes size_mm, has radius_mm and size"),
        (ROBOT.replace("[80, 300, 60]", "[80, 0, 60]"), RigError, "size_mm"),
        (POLE.replace("radius_mm = 15\n", ""), RigError, "height_mm and radius_mm"),
        (
            ROBOT.replace("centre_mm = [60, 0, 150]\n", ""),
            RigError,
            "centre_mm is miss",
        ),
        (ROBOT + 'unit = "mm"\n', RigError, "write it beside file"),
        (
            ARM.replace("arm.stl", "none.stl"),
            RigError,
            "obstacle 'arm'.*none.stl",
        ),
        (
            ROBOT.replace("[80, 300, 60]", "[80, 3e5, 60]"),
            RigError,
            "size_mm.1.` = 300000.*less than or equal to 100000",
        ),
        (POLE.replace("= 300", "= 1e9"), RigError, "height_mm` = 1000000000"),
        (
            POLE.replace("= 15", "= 1e-12"),
            RigError,
            "obstacle 'pole': faces must be",
        ),
        (
            '[[workspace.keep_out]]\nname = "beyond"\ncentre_mm = [0, 0, 1e6]\n'
            "size_mm = [1e6, 1e6, 1e6]\n",
            RigError,
            "at most 100000 mm; write smaller ones, or blocks = false",
        ),
        (
            '[[workspace.keep_out]]\nname = "about it"\ncentre_mm = [0, 0, 0]\n'
            "size_mm = [300, 300, 300]\n",
            InfeasibleLimitsError,
            "'about it' holds 100 % of the object.*blocks = false",
        ),
    ],
)
def test_bad_obstacles_are_refused(rig_of, text, error, message):
    with pytest.raises(error, match=message):
        standing(rig_of(text), plate())


def test_a_file_that_is_missing_is_told_before_the_work(rig_of):
    rig, said = rig_of(ARM.replace("arm.stl", "none.stl")), []
    with pytest.raises(RigError, match=r"obstacle 'arm'.*none.stl"):
        plan_rig(plate(), rig, max_projectors=1, progress=said.append)
    assert not any("curvature" in line for line in said)


def test_zones_block_unless_they_say_otherwise(rig_of):
    zone = (
        '[[workspace.keep_out]]\nname = "press"\ncentre_mm = [900, 0, 200]\n'
        "size_mm = [900, 700, 800]\nturn_deg = [10, 20, 30]\n"
    )
    (press,) = standing(rig_of(zone), plate())
    assert press.name == "press"
    assert press.mesh.area == pytest.approx(2 * (0.63 + 0.56 + 0.72))
    assert standing(rig_of(zone + "blocks = false\n"), plate()) == ()


# ---- what they hide


def test_lines_are_crossed_as_by_trimesh(rig_of):
    rng = np.random.default_rng(4)
    shape = primitives.cylinder(0.1, 0.3)
    solid = Obstruction("it", shape, 1e-7)
    starts, ends = rng.normal(size=(2, 4000, 3)) * 0.4
    crossed = solid.crossed(starts, ends)
    ways = ends - starts
    plain = to_trimesh(shape).ray.intersects_location(
        starts, ways / np.linalg.norm(ways, axis=1)[:, None]
    )
    met = np.zeros(len(starts), dtype=bool)
    reach = np.linalg.norm(plain[0] - starts[plain[1]], axis=1)
    met[plain[1][reach < np.linalg.norm(ways, axis=1)[plain[1]]]] = True
    assert np.count_nonzero(crossed != met) <= 2
    assert 300 < met.sum() < 3700


def test_a_clipped_obstacle_keeps_to_the_ball():
    shape = primitives.box((0.2, 4.0, 0.2))
    centre = np.array([0.0, 0.1, 0.0])
    part = clipped_to_ball(shape, centre, 1.0)
    assert part is not None
    away = np.linalg.norm(part.vertices - centre, axis=1)
    assert 0.88 < away.max() <= 1.0
    assert clipped_to_ball(shape, np.array([5.0, 0.0, 0.0]), 1.0) is None
    whole = clipped_to_ball(shape, centre, 9.0)
    assert whole is not None
    assert whole.area == pytest.approx(shape.area)


def best_plan(rig, mesh, few, **wishes):
    try:
        with few():
            wishes = {"target": "surface", "cameras_by": "cover"} | wishes
            return plan_rig(mesh, rig, max_projectors=4, check=False, **wishes)
    except RequirementError as missed:
        return missed.plan


@pytest.fixture(scope="module")
def planned(tmp_path_factory, with_little_work):
    path = tmp_path_factory.mktemp("rig") / "cell.toml"
    path.write_text(f'base = "default"\n{ROBOT}{POLE}{BENCH}{GROUND}{SMALL}')
    return best_plan(load_rig(path), plate(), with_little_work, cameras_by="both")


def lines_of(plan):
    """Ends of each way of light and of sight to samples that a pair measures."""
    actual = audit_plan(plan, n_samples=3000).case.actual
    lit = actual.lit_by & actual.measured
    for device, seen in (
        *zip(plan.projectors, lit, strict=True),
        *zip(plan.cameras, actual.measured_by, strict=True),
    ):
        yield device.world_from_device[:3, 3], actual.samples.points[seen]


def test_no_ray_of_a_measured_sample_meets_an_obstacle(planned):
    """By trimesh's own rays, of light and of sight."""
    assert audit_plan(planned, n_samples=3000).failures == ()
    solids = trimesh.util.concatenate(
        [to_trimesh(solid.mesh) for solid in planned.surface.obstacles]
    )
    n = 0
    for start, points in lines_of(planned):
        ways = points - start
        lengths = np.linalg.norm(ways, axis=1)
        spots, ray, _ = solids.ray.intersects_location(
            np.broadcast_to(start, ways.shape), ways / lengths[:, None]
        )
        reach = np.linalg.norm(spots - start, axis=1)
        assert not np.any(reach < lengths[ray] - 1e-4)
        n += len(points)
    assert n > 400


HOUSED = (
    "[projector.body]\nsize_mm = [400, 400, 250]\ncentre_mm = [0, 0, -100]\n"
    "[camera.body]\nsize_mm = [300, 300, 200]\ncentre_mm = [0, 0, -60]\n"
)
# It stands under the bench and looks away.
STANDING = (
    '[[existing]]\nname = "wall"\nkind = "projector"\n'
    "position_mm = [0, 0, -800]\naim_mm = [0, 0, -2000]\n"
)
# Between that and the bench: what shines through it meets the housing first.
SIGN = (
    '[[obstacle]]\nname = "sign"\nshape = "box"\ncentre_mm = [0, 0, -500]\n'
    "size_mm = [20, 20, 5]\n"
)


@pytest.mark.long
def test_housings_and_obstacles_are_told_apart(rig_of, with_little_work):
    """What the bench keeps all reference projectors from no housing is blamed for.

    Nor is an obstacle that one of these projectors meets behind a housing.
    """
    rig = rig_of(HOUSED + BENCH + SIGN + STANDING + SMALL)
    plan = best_plan(rig, plate(), with_little_work)
    coverage = plan.coverage
    assert coverage.blocked_by_obstacle_m2["bench"] > 0.3 * coverage.target.area_m2
    assert coverage.blocked_by_obstacle_m2["sign"] == 0.0
    assert max(coverage.blocked_by_body_m2.values()) < 0.1 * coverage.target.area_m2
    assert audit_plan(plan, n_samples=3000).failures == ()


@pytest.mark.long
def test_what_they_cost_is_told_by_name(planned, rig_of, with_little_work):
    coverage = planned.coverage
    assert set(coverage.blocked_by_obstacle_m2) == {"robot", "pole", "bench"}
    assert "blocked_by_obstacle" in {
        *coverage.uncovered_by_cause,
        *coverage.unreachable_by_cause,
    }
    text = summary(planned, (), ())
    assert "behind an obstacle" in text
    free = best_plan(rig_of(SMALL), plate(), with_little_work)
    assert free.coverage.target.reachable_by_projectors_m2 > (
        coverage.target.reachable_by_projectors_m2
    )
    assert "obstacle" not in free.to_document()["rig"]
    assert "blocked_by_obstacle_m2" not in free.to_document()["coverage"]


def test_they_are_drawn(planned):
    bare = RigPlan(planned.document, replace(planned.surface, obstacles=()))
    with_them, without = (
        np.asarray(draw_rig(plan, face_status=face_status(planned), size=(800, 500)))
        for plan in (planned, bare)
    )
    assert not np.array_equal(with_them, without)


def test_one_that_is_called_like_forbidden_ground_is_drawn(planned):
    figures = obstacle_figures(planned, 2.0)
    assert [figure.name for figure in figures] == ["robot", "pole", "bench"]


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("obstacle_faces", np.zeros((0, 3), int), "obstacle_of_face"),
        ("obstacle_of_face", np.array([7]), "name an obstacle for each face"),
        ("obstacle_vertices", np.full((1, 3), 1e300), r"floats of less than 1e\+09"),
        ("obstacle_vertices", np.zeros((1, 3)), "`obstacle_faces`: face indices span"),
        ("obstacle_names", np.array(["a"] * 9), "`obstacle_faces`: faces must be"),
        ("obstacle_names", np.array(["a\ud800"]), r"must be \(n\) names, got <U2"),
        ("obstacle_names", np.array([2**31 - 1], "i4").view("<U1"), "names, got <U1"),
        ("obstacle_names", np.array([b"a"]), r"names, got \|S1"),
    ],
)
def test_broken_arrays_of_obstacles_are_refused(
    planned, tmp_path, name, value, message
):
    with np.load(BytesIO(planned.surface.content)) as archive:
        arrays = {**archive, name: value}
    np.savez(tmp_path / "surface.npz", **arrays)
    with pytest.raises(PlanFileError, match=message):
        Surface.load(tmp_path / "surface.npz")


def test_surface_files_hold_them(planned, tmp_path):
    planned.save(tmp_path / "plan.json")
    again = RigPlan.load(tmp_path / "plan.json")
    for one, other in zip(
        planned.surface.obstacles, again.surface.obstacles, strict=True
    ):
        assert one.name == other.name
        assert np.array_equal(one.mesh.corners, other.mesh.corners)
    assert again.surface.sha256() == planned.surface.sha256()


def test_the_renderer_has_them_beside_bodies(planned):
    rig = SimpleNamespace(
        projectors=(), cameras=(), obstacles=planned.surface.obstacles
    )
    caster = obstacles_of(rig, "P1")
    assert caster is not None
    assert caster.mesh.area == pytest.approx(
        sum(solid.mesh.area for solid in planned.surface.obstacles)
    )


@pytest.mark.parametrize("name", ["robot", "pole", "bench"])
def test_an_obstacle_that_was_moved_is_told(planned, name):
    def moved(solid):
        if solid.name != name:
            return solid
        shape = TriangleMesh(solid.mesh.vertices + [0.0, 0.0, 1e-4], solid.mesh.faces)
        return Obstacle(name, shape)

    solids = tuple(moved(solid) for solid in planned.surface.obstacles)
    tampered = RigPlan(planned.document, replace(planned.surface, obstacles=solids))
    failures = audit_plan(tampered, n_samples=500).failures
    assert any(f"obstacle '{name}': differs" in failure for failure in failures)


def test_an_obstacle_that_is_left_out_is_told(planned):
    few = replace(planned.surface, obstacles=planned.surface.obstacles[:2])
    failures = audit_plan(RigPlan(planned.document, few), n_samples=500).failures
    assert any("surface.npz holds ['robot', 'pole']" in text for text in failures)
    document = planned.to_document()
    document["coverage"]["blocked_by_obstacle_m2"]["bench"] += 0.002
    lied = RigPlan.from_document(document, planned.surface)
    failures = audit_plan(lied, n_samples=3000).failures
    assert any("blocked_by_obstacle_m2.bench" in text for text in failures)
