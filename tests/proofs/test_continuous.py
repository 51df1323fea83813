"""Bounds over all poses: supersets that random poses never leave, counts known."""

from dataclasses import replace

import igl
import numpy as np
import pytest
from support.factories import make_projector, make_requirements, make_scene
from support.plain_shapes import box, cylinder, grid, joined, torus

from geometry.directions.cube_map import CubeMap
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere
from planning.model.devices.bodies import Box
from planning.proofs import projector_bound as continuous
from planning.proofs.all_poses import BoundQuestion, Effort
from planning.proofs.cells.direction_cells import DirectionTree
from planning.proofs.cells.lit_cells import LitCells
from planning.proofs.projector_bound import DEFAULT, bound_projectors
from planning.rig.rig import load_rig
from planning.scene.draws import Draw
from planning.scene.samples import Target
from planning.scene.scene import Scene
from solvers.bit_rows import pack_rows, unpack_rows
from solvers.cells.cell_bound import CellStatus

QUICK = Effort(finest=6, maps=6, budget=1e9, shadows=np.inf)
RADII = np.array([0.1, 0.45])


def shifted(mesh: TriangleMesh, by: tuple[float, float, float]) -> TriangleMesh:
    return TriangleMesh(mesh.vertices + np.array(by), mesh.faces)


def stage_for(mesh, light, *, tangent_deg=0.0, steep=(0.0, 0.0, 0.0), **workspace):
    """A scene whose target is the whole surface, and a projector without a pose."""
    rig = load_rig("default", light=light)
    required = make_requirements(mesh, rig, max_projectors=9)
    required = replace(
        required,
        projector=replace(
            required.projector, min_tangent_angle=np.deg2rad(tangent_deg)
        ),
        workspace=replace(required.workspace, **workspace),
    )
    t1 = np.cross(mesh.face_normals, np.array(steep))
    length = np.linalg.norm(t1, axis=1, keepdims=True)
    t1 = np.divide(t1, length, out=np.zeros_like(t1), where=length > 0)
    scene = make_scene(mesh, required, steep=t1)
    return scene, make_projector(rig, RADII)


def question(required, count, n_samples=300, sample_area_m2=1e-6):
    return BoundQuestion(required, count, n_samples, sample_area_m2)


def bounded(mesh, light, share, count, effort=QUICK, n=400, **options):
    scene, template = stage_for(mesh, light, **options)
    rows = scene.target_samples(Draw(n, 3))
    required = int(np.ceil(share * n - 1e-9))
    asked = question(required, count, n, rows.samples.weight)
    return bound_projectors(scene, (template,), rows, asked, effort)


SHAPES = {
    "ring": torus(0.07, 0.035, around=32, about_tube=20),
    "box over a plate": joined(
        grid(0.2, 0.2, divisions=(3, 3)), shifted(box((0.05, 0.04, 0.03)), (0, 0, 0.05))
    ),
}


def lit_by_hand(
    scene: Scene, rows: Target, towards: np.ndarray, reach: np.ndarray | float
) -> np.ndarray:
    """Whether eq. (2) holds and libigl, in float64, finds nothing in between.

    Args:
        scene: Surface and limits.
        rows: Samples.
        towards: Unit directions from samples to the device, shape (n, 3).
        reach: Distance of the device.
    """
    limits, mesh = scene.requirements.projector, scene.mesh
    normals = rows.samples.normals
    lit = np.einsum("ij,ij->i", normals, towards) >= np.cos(limits.max_incidence)
    tangent = np.abs(np.einsum("ij,ij->i", rows.steep, towards))
    lit &= tangent <= np.cos(limits.min_tangent_angle)
    tree = igl.AABB()
    vertices = np.ascontiguousarray(1e6 * mesh.vertices)
    faces = np.ascontiguousarray(mesh.faces)
    tree.init(vertices, faces)
    starts = 1e6 * (rows.samples.points + 1e-6 * normals)
    face, distance, _ = tree.intersect_ray_first(
        vertices, faces, np.ascontiguousarray(starts), np.ascontiguousarray(towards)
    )
    return lit & ~(
        (face >= 0) & (distance < 1e6 * np.broadcast_to(reach, len(towards)))
    )


def misses(tree, rows_of, inside, lit) -> int:
    """Count lit samples that a cell which holds the pose doesn't have, walking down."""
    batch, total, depth = tree.roots(), 0, 0
    while batch.cells.size:
        own = np.array([inside(cell) for cell in batch.cells], dtype=bool)
        assert own.any(), "a pose of the workspace is in no cell"
        held = unpack_rows(batch.rows[own], tree.n_rows)
        total += int(np.count_nonzero(lit & ~held))
        batch, depth = tree.children(batch.cells[own]), depth + 1
    assert depth > rows_of
    return total


def direction_holder(tree, towards):
    def inside(cell):
        level, own = tree.place(np.array([cell]))
        return CubeMap(1 << int(level[0])).locate(towards[None])[0] == own[0]

    return inside


def position_holder(tree, offset):
    distance = np.linalg.norm(offset)

    def inside(cell):
        found = tree.cells(np.array([cell]))
        own = CubeMap(1 << int(found.level[0])).locate(offset[None])[0]
        held = found.low_m[0] <= distance <= found.high_m[0]
        return held and own == found.cell[0]

    return inside


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "light", "tangent_deg"),
    [
        ("ring", "parallel", 40.0),
        ("ring", "diverging", 0.0),
        ("box over a plate", "parallel", 0.0),
        ("box over a plate", "diverging", 40.0),
    ],
)
def test_no_pose_lights_what_its_cells_lack(name, light, tangent_deg):
    scene, template = stage_for(
        SHAPES[name], light, tangent_deg=tangent_deg, steep=(0.3, 0.2, 1.0)
    )
    rows = scene.target_samples(Draw(300, 5))
    found = bound_projectors(scene, (template,), rows, question(250, 9), QUICK)
    assert found.shadows
    tree = found.found.tree
    workspace = scene.requirements.workspace
    near, far = workspace.projector_radius_m
    rng = np.random.default_rng(11)
    lit_at_all = 0
    for _ in range(40):
        towards = rng.normal(size=3)
        towards /= np.linalg.norm(towards)
        if light == "parallel":
            every = np.broadcast_to(towards, rows.samples.points.shape)
            lit = lit_by_hand(scene, rows, every, np.inf)
            inside = direction_holder(tree, towards)
        else:
            offset = rng.uniform(near, far) * towards
            to_device = np.array(workspace.centre) + offset - rows.samples.points
            reach = np.linalg.norm(to_device, axis=1)
            lit = lit_by_hand(scene, rows, to_device / reach[:, None], reach)
            low, high = template.device.range_m
            lit &= (reach >= low) & (reach <= high)
            inside = position_holder(tree, offset)
        assert misses(tree, 3, inside, lit) == 0
        lit_at_all += int(lit.sum())
    assert lit_at_all > 40 * 20


def test_a_cell_with_a_sample_too_few_is_caught():
    """The attack above sees a superset that isn't one."""
    scene, template = stage_for(SHAPES["ring"], "parallel")
    rows = scene.target_samples(Draw(300, 5))
    found = bound_projectors(scene, (template,), rows, question(250, 9), QUICK)
    tree = found.found.tree
    towards = np.array([0.1, -0.2, 0.97]) / np.linalg.norm([0.1, -0.2, 0.97])
    lit = lit_by_hand(
        scene, rows, np.broadcast_to(towards, rows.samples.points.shape), np.inf
    )
    leaves = unpack_rows(tree.levels[-1], tree.n_rows)
    cell = CubeMap(64).locate(towards[None])[0]
    leaves[cell, np.flatnonzero(lit)[7]] = False
    poorer = DirectionTree.over(pack_rows(leaves), tree.n_rows)
    assert misses(poorer, 3, direction_holder(poorer, towards), lit) == 1


@pytest.mark.parametrize("light", ["parallel", "diverging"])
def test_cells_hold_the_cone_and_what_is_over_the_floor(light):
    """A pose within the workspace is in a cell that has not been emptied."""
    mesh = SHAPES["ring"]
    axis = np.array([0.6, 0.0, 0.8])
    options = {"axis": tuple(axis), "half_angle": 0.9, "floor_m": 0.3}
    scene, template = stage_for(mesh, light, **options)
    rows = scene.target_samples(Draw(200, 5))
    found = bound_projectors(scene, (template,), rows, question(100, 3), QUICK)
    tree, workspace = found.found.tree, scene.requirements.workspace
    near, far = workspace.projector_radius_m
    rng = np.random.default_rng(2)
    tried = 0
    while tried < 25:
        outwards = rng.normal(size=3)
        outwards /= np.linalg.norm(outwards)
        offset = rng.uniform(near, far) * outwards
        if outwards @ axis < np.cos(0.9) or offset[2] < 0.3:
            continue
        tried += 1
        if light == "parallel":
            # Aimed at any point of the object, not only at its centre.
            aim = 0.7 * scene.mesh.radius * rng.normal(size=3) / 2.0
            towards = (offset - aim) / np.linalg.norm(offset - aim)
            every = np.broadcast_to(towards, rows.samples.points.shape)
            lit = lit_by_hand(scene, rows, every, np.inf)
            inside = direction_holder(tree, towards)
        else:
            to_device = np.array(workspace.centre) + offset - rows.samples.points
            reach = np.linalg.norm(to_device, axis=1)
            lit = lit_by_hand(scene, rows, to_device / reach[:, None], reach)
            inside = position_holder(tree, offset)
        assert misses(tree, 3, inside, lit) == 0
    leaves = tree.roots().rows
    assert unpack_rows(leaves, 200).any()
    # The far side of the shell is empty.
    below = -axis if light == "parallel" else -near * axis
    holder = direction_holder if light == "parallel" else position_holder
    cells = [c for c in tree.roots().cells if holder(tree, below)(c)]
    for _ in range(3):
        batch = tree.children(np.array(cells))
        kept = np.array([holder(tree, below)(c) for c in batch.cells])
        cells, held = batch.cells[kept].tolist(), batch.rows[kept]
    assert not unpack_rows(held, 200).any()


@pytest.mark.parametrize("light", ["parallel", "diverging"])
def test_rooms_planes_and_keep_out_volumes_empty_cells_and_only_theirs(light):
    """Above and below a ring, but for a volume above; a mounting plane on either side.

    Every position that is left stays in a cell with all that it lights.
    """
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    options = {
        "box": Box("room", (0.0, 0.0, 0.0), (2.0, 0.4, 2.0), axes),
        "mounting": (
            Box("over", (0.0, 0.0, 1.05), (2.0, 2.0, 0.05), axes),
            Box("beside", (1.05, 0.0, 0.0), (0.05, 2.0, 0.3), axes),
        ),
        "keep_out": (Box("lamp", (0.4, 0.0, 1.0), (0.35, 1.0, 0.5), axes),),
    }
    scene, template = stage_for(SHAPES["ring"], light, **options)
    rows = scene.target_samples(Draw(200, 5))
    found = bound_projectors(scene, (template,), rows, question(100, 3), QUICK)
    tree, workspace = found.found.tree, scene.requirements.workspace
    near, far = workspace.projector_radius_m
    rng = np.random.default_rng(2)
    tried = lit_at_all = 0
    while tried < 25:
        plane = options["mounting"][tried % 2]
        offset = np.array(plane.centre_m) + rng.uniform(-1, 1, 3) * plane.half_m
        blocked = abs(offset[0] - 0.4) < 0.35 and abs(offset[2] - 1.0) < 0.5
        if blocked or abs(offset[1]) > 0.4 or not near < np.linalg.norm(offset) < far:
            continue
        tried += 1
        if light == "parallel":
            aim = 0.35 * scene.mesh.radius * rng.normal(size=3)
            towards = (offset - aim) / np.linalg.norm(offset - aim)
            every = np.broadcast_to(towards, rows.samples.points.shape)
            lit = lit_by_hand(scene, rows, every, np.inf)
            inside = direction_holder(tree, towards)
        else:
            to_device = np.array(workspace.centre) + offset - rows.samples.points
            reach = np.linalg.norm(to_device, axis=1)
            lit = lit_by_hand(scene, rows, to_device / reach[:, None], reach)
            inside = position_holder(tree, offset)
        assert misses(tree, 3, inside, lit) == 0
        lit_at_all += int(lit.sum())
    assert lit_at_all > 25 * 20
    # Nothing is mounted below, nor in front of the room.
    middle = 0.5 * (near + far)
    for towards in ((0.02, 0.01, -1.0), (0.01, -1.0, 0.02)):
        gone = middle * np.array(towards)
        held = (direction_holder if light == "parallel" else position_holder)(
            tree, gone / np.linalg.norm(gone) if light == "parallel" else gone
        )
        cells = [c for c in tree.roots().cells if held(c)]
        for _ in range(4):
            batch = tree.children(np.array(cells))
            kept = np.array([held(c) for c in batch.cells])
            cells, bits = batch.cells[kept].tolist(), batch.rows[kept]
        assert not unpack_rows(bits, 200).any()


@pytest.mark.long
@pytest.mark.parametrize(
    ("shape", "share", "count"),
    [
        # A cap of 60 degrees holds a quarter of a sphere.
        (sphere(0.08, subdivisions=4), 0.48, 2),
        (sphere(0.08, subdivisions=4), 0.62, 3),
        # From a corner three sides of a cube are met at 54.7 degrees.
        (box((0.1, 0.1, 0.1), divisions=4), 1.0, 2),
        # Of the side of a cylinder, 120 degrees around.
        (cylinder(0.05, 0.12, capped=False), 0.33, 1),
        (cylinder(0.05, 0.12, capped=False), 0.75, 3),
    ],
)
def test_counts_in_parallel_light_are_those_of_closed_form(shape, share, count):
    found = bounded(shape, "parallel", share, count).found
    assert found.lower_bound == count, found.proof
    more = bounded(shape, "parallel", share, count + 1).found
    assert more.lower_bound <= count


def test_plates_that_face_each_other_need_light_through_the_gap():
    """Two plates of 100 mm, 60 mm apart, lit on their inner sides.

    Light at 60 degrees enters by tan 60 x 60 = 104 mm: it reaches all of a plate from
    outside, over the other's edge, but never both: one direction meets one of them.
    """
    plate = grid(0.1, 0.1, divisions=(6, 6))
    other = TriangleMesh(plate.vertices + [0, 0, 0.06], plate.faces[:, ::-1])
    pair = joined(plate, other)
    assert bounded(pair, "parallel", 0.5, 1, n=400).found.lower_bound == 1
    assert bounded(pair, "parallel", 0.95, 2, n=400).found.lower_bound == 2
    # Without shadows a direction still meets only one of the two.
    none = replace(QUICK, shadows=0.0)
    assert not bounded(pair, "parallel", 0.95, 2, none, n=400).shadows
    # 10 mm apart, light enters 17 mm: four directions a plate light its rim.
    near = joined(
        plate, TriangleMesh(plate.vertices + [0, 0, 0.01], plate.faces[:, ::-1])
    )
    found = bounded(near, "parallel", 0.9, 9, n=400).found
    assert found.status is CellStatus.INFEASIBLE
    assert bounded(near, "parallel", 0.9, 9, none, n=400).found.lower_bound == 2


def test_one_projector_is_the_fewest_without_a_look_at_cells():
    entry = (
        bounded(sphere(0.08, subdivisions=3), "diverging", 0.2, 1, n=100)
        .proof()
        .to_document()
    )
    assert (entry["lower_bound"], entry["status"]) == (1, "proved")
    assert entry["occlusion"] is True
    assert entry["n_cells"] == 6


def test_devices_inside_the_object_cast_no_shadows_that_are_relied_on():
    """Where the shell cuts the object, something may stand behind the device."""
    mesh = SHAPES["box over a plate"]
    for light in ("parallel", "diverging"):
        effort = replace(QUICK, finest=4, maps=4)
        shell = {"projector_radius_m": (0.05, 1.2), "n": 100}
        found = bounded(mesh, light, 0.3, 2, effort, **shell)
        assert not found.shadows


def test_the_entry_says_what_was_proved():
    ball = sphere(0.08, subdivisions=4)
    entry = bounded(ball, "parallel", 0.48, 2).proof().to_document()
    assert (entry["lower_bound"], entry["status"]) == (2, "proved")
    assert (entry["n_samples"], entry["n_reached"]) == (400, 400)
    assert entry["occlusion"] is True
    assert entry["n_cells"] > 6
    # One projector lights a quarter of the ball at most, and less than is required.
    assert 0.25 * ball.area < entry["one_fewer_upper_bound_m2"] < 0.48 * ball.area
    cut = (
        bounded(ball, "parallel", 0.9, 7, replace(QUICK, budget=1e6))
        .proof()
        .to_document()
    )
    assert cut["status"] == "cut"
    assert 1 <= cut["lower_bound"] < 7


def test_cells_that_are_left_are_where_the_better_cover_is():
    """Two poses light a cube; a cover of three is improved where the cells point."""
    scene, template = stage_for(box((0.1, 0.1, 0.1), divisions=4), "parallel")
    rows = scene.target_samples(Draw(600, 3))
    found = bound_projectors(scene, (template,), rows, question(600, 3), DEFAULT)
    assert found.found.lower_bound == 2
    corners = np.abs(found.directions)
    np.testing.assert_allclose(corners, 3**-0.5, atol=0.15)
    assert len(corners) == 2
    # More may be asked for: where the multipliers say that much is to be had.
    asked = replace(DEFAULT, offers=40)
    more = bound_projectors(
        scene, (template,), rows, question(600, 3), asked
    ).directions
    assert len(more) == 42
    np.testing.assert_allclose(np.linalg.norm(more, axis=1), 1.0)
    assert continuous.PROVE.finest > DEFAULT.finest


def test_what_is_sure_of_a_cell_changes_no_row_of_its_parts(monkeypatch):
    scene, template = stage_for(
        SHAPES["box over a plate"], "diverging", tangent_deg=40.0
    )
    rows = scene.target_samples(Draw(200, 3))

    def cells():
        effort = replace(QUICK, finest=7, maps=5, budget=1.0)
        asked = question(200, 3)
        tree = bound_projectors(scene, (template,), rows, asked, effort).found.tree
        layers, before = [], tree.units
        batch = tree.roots()
        for _ in range(6):
            batch = tree.children(batch.cells[:: max(1, batch.cells.size // 40)])
            layers.append(batch.rows)
        return np.concatenate(layers), tree.units - before

    quick, little = cells()
    admitted = LitCells.admitted

    def never_sure(cells, samples, *seen):
        may, surely = admitted(cells, samples, *seen)
        return may, np.zeros_like(surely)

    monkeypatch.setattr(LitCells, "admitted", never_sure)
    plain, much = cells()
    np.testing.assert_array_equal(quick, plain)
    assert little < much
