"""The attack on cells in small, and a cell that lacks a sample: the attack sees it."""

from dataclasses import replace

import numpy as np
import pytest
from support.factories import make_projector, make_requirements, make_scene

from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.primitives import sphere
from planning.proofs.cells.direction_cells import DirectionTree
from planning.proofs.cells.position_cells import PositionTree
from planning.proofs.cells.shell_cells import spread
from planning.rig.rig import load_rig
from planning.scene.draws import Draw
from solvers.bit_rows import pack_rows, unpack_rows

POSES = 2000


@pytest.fixture(scope="module")
def attack_cells(benchmark_module):
    return benchmark_module("bounds.attack_cells")


def notched_box(side=0.03):
    """Blocks of one side in a U: what lies in the notch is lit through its mouth."""
    solid = np.ones((3, 2, 2), dtype=bool)
    solid[1, :, 1] = False
    around = np.pad(solid, 1)
    corners: dict[tuple[int, ...], int] = {}
    faces = []
    for place in np.argwhere(solid):
        for axis in range(3):
            for sign in (1, -1):
                step = sign * np.eye(3, dtype=int)[axis]
                if around[tuple(place + 1 + step)]:
                    continue
                a, b = np.eye(3, dtype=int)[[(axis + 1) % 3, (axis + 2) % 3]]
                start = place + np.maximum(step, 0)
                quad = [start, start + a, start + a + b, start + b][::sign]
                ids = [corners.setdefault(tuple(q), len(corners)) for q in quad]
                faces += [ids[:3], [ids[0], ids[2], ids[3]]]
    points = side * (np.array(list(corners), dtype=float) - [1.5, 1.0, 1.0])
    return TriangleMesh(points, np.array(faces))


SHAPES = {"sphere": sphere(0.06, subdivisions=3), "notched box": notched_box()}


def made(mesh, light, attack_cells):
    rig = load_rig("default", light=light)
    required = make_requirements(mesh, rig, max_projectors=9)
    limits = replace(required.projector, min_tangent_angle=np.radians(40.0))
    required = replace(required, projector=limits)
    steep = np.cross(mesh.face_normals, [0.3, 0.2, 1.0])
    steep /= np.linalg.norm(steep, axis=1)[:, None]
    scene = make_scene(mesh, required, steep=steep)
    template = make_projector(rig, np.array([0.1, 0.4]))
    scene, template = attack_cells.fitted(
        scene, template, "close" if light == "diverging" else "default"
    )
    rows = scene.target_samples(Draw(128, 5))
    tree = attack_cells.tree_of(scene, template, rows, 4)
    assert tree is not None
    return scene, template, rows, tree


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("light", ["parallel", "diverging"])
def test_no_pose_leaves_the_set_of_its_cell_until_one_bit_is_cleared(
    name, light, attack_cells
):
    scene, template, rows, tree = made(SHAPES[name], light, attack_cells)
    tally = attack_cells.attack(scene, template, rows, tree, POSES, seed=1)
    assert tally.violations == ()
    assert tally.suspects == 0
    assert tally.lit > 5 * POSES
    assert tally.depth >= 5
    # A pose of the same attack, and a sample that it lights.
    rng = np.random.default_rng((1, POSES))
    poses = attack_cells.random_poses(scene, template, rows, 500, rng)
    limits = scene.requirements.projector
    own = attack_cells.OwnLight(
        scene.mesh,
        rows,
        limits.max_incidence,
        limits.min_tangent_angle,
        template.device.range_m,
    )
    pose, sample = np.argwhere(own.lit(poses))[17]
    poorer = without(tree, poses.key[pose], sample, attack_cells)
    caught = attack_cells.attack(scene, template, rows, poorer, POSES, seed=1)
    key = tuple(poses.key[pose].tolist())
    assert (key, sample) in caught.violations
    assert {s for _, s in caught.violations} == {sample}


def test_cells_are_the_same_by_any_number_of_threads(attack_cells, monkeypatch):
    monkeypatch.setattr("planning.proofs.cells.position_cells.PAIRS", 64)
    found, box = [], SHAPES["notched box"]
    for threads in (1, 3):
        scene, template, rows, _ = made(box, "diverging", attack_cells)
        scene.visibility.caster.threads = threads
        tree = attack_cells.tree_of(scene, template, rows, 3)
        names = tree.roots().cells
        for _ in range(3):
            names = tree.children(names).cells
        found.append(tree.covered(names))
    assert 0 < found[0].sum() < found[0].size
    np.testing.assert_array_equal(*found)


def without(tree, key, sample, attack_cells):
    """Clear a sample's bit in the finest cell that holds a pose."""
    if isinstance(tree, DirectionTree):
        n = round((len(tree.levels[-1]) / 6) ** 0.5)
        first = 2 * (4 ** (len(tree.levels) - 1) - 1)
        names = first + np.arange(6 * n * n)
        held = attack_cells.lies_in(tree, names[None], key[None, None])[0]
        leaves = unpack_rows(tree.levels[-1], tree.n_rows)
        assert leaves[np.flatnonzero(held), sample].all()
        leaves[np.flatnonzero(held), sample] = False
        return DirectionTree(
            (*tree.levels[:-1], pack_rows(leaves)),
            tree.n_rows,
        )
    assert isinstance(tree, PositionTree)
    cell = None
    batch = tree.roots()
    while batch.cells.size:
        held = attack_cells.lies_in(tree, batch.cells[None], key[None, None])[0]
        cell = int(batch.cells[np.flatnonzero(held)[0]])
        batch = tree.children(np.array([cell]))
    bits = tree._rows.values[cell].view(np.uint8)
    assert bits[sample // 8] >> (7 - sample % 8) & 1
    bits[sample // 8] &= ~np.uint8(1 << (7 - sample % 8))
    return tree


def test_seen_from_a_sample_no_place_of_a_cell_is_beyond_its_angle():
    """psi holds the inner and outer end of a cell, wherever the sample is."""
    rng = np.random.default_rng(0)
    slack = []
    for _ in range(300):
        outwards = rng.normal(size=3)
        outwards /= np.linalg.norm(outwards)
        low = rng.uniform(0.5, 1.0)
        high, angle = low + rng.uniform(0.0, 0.8), rng.uniform(0.0, 0.05)
        half, middle = 0.5 * (high - low), 0.5 * (high + low)
        # Samples inside the shell, and far outside of it.
        points = rng.normal(size=(20, 3)) * rng.choice([0.15, 2.0])
        towards = middle * outwards - points
        distance = np.linalg.norm(towards, axis=1)
        side = 2.0 * high * np.sin(0.5 * angle)
        psi = spread(towards, distance, outwards, half, side)
        # Places at the rim of the cell: any turn by its angle, both ends and between.
        turn = np.cross(outwards, rng.normal(size=(40, 3)))
        turn /= np.linalg.norm(turn, axis=1)[:, None]
        lean = angle * rng.choice([0.0, 1.0], 40)[:, None]
        rim = np.cos(lean) * outwards + np.sin(lean) * turn
        places = rng.choice([low, middle, high], 40)[:, None] * rim
        to_place = places[:, None] - points
        cosine = np.einsum("kni,ni->kn", to_place, towards)
        cosine /= np.linalg.norm(to_place, axis=2) * distance
        seen = np.arccos(np.clip(cosine, -1.0, 1.0)).max(axis=0)
        assert np.all(seen <= psi + 1e-7)
        slack += (psi - seen)[psi < np.pi].tolist()
    # It is no wider than it has to be.
    assert np.quantile(slack, 0.1) < 0.002


def test_cells_asked_for_together_have_the_rows_that_each_has_alone(attack_cells):
    """Pairs of cell and sample are looked at by the thousand: none takes another's."""
    tree, alone = (
        made(SHAPES["notched box"], "diverging", attack_cells)[3] for _ in range(2)
    )
    together = tree.roots()
    own = dict(zip(together.cells.tolist(), alone.roots().cells, strict=True))
    for _ in range(4):
        names = together.cells
        together = tree.children(names)
        parts = {
            int(name): alone.children(np.array([own[int(name)]])) for name in names
        }
        own = {}
        for name in names:
            found, mine = parts[int(name)], names[together.parents] == name
            np.testing.assert_array_equal(together.rows[mine], found.rows)
            own |= dict(zip(together.cells[mine].tolist(), found.cells, strict=True))
    assert len(own) > 300
    assert np.bitwise_count(together.rows).sum() > len(own)
