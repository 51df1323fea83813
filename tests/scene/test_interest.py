"""A user's own target: read from files and PLY properties, planned and verified."""

import hashlib
import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.plain_shapes import box, flipped, joined

from geometry.curvature.curvature import principal_curvatures
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.regions.selected_regions import regions_of_faces
from geometry.shapes.primitives import sphere
from planning import RigPlan, load_rig, plan_rig, verify_plan
from planning.cli.main import main
from planning.model.errors import InputError
from planning.report.made_again import made_again
from planning.report.summary.summary import summary
from planning.scene.interest import interest_of, read_selection, read_weight
from planning.verify.audit.audit import audit_plan
from planning.verify.held_figures import EXACTLY
from planning.verify.trust import of_surface

# Side of the box that is painted: +z, of six with 4 x 4 quads each.
TOP, N = 4, 4


class QuadBox:
    """A box of quads in a PLY file; each side has vertices of its own (seams)."""

    def __init__(self, seed: int = 0, *, inside_out: bool = False) -> None:
        vertices, quads, sides, owners = [], [], [], []
        size = np.array([80.0, 60.0, 40.0])
        for side in range(6):
            axis, sign = side // 2, 1.0 - 2.0 * (side % 2)
            u, v = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
            first = len(vertices)
            for j in range(N + 1):
                for i in range(N + 1):
                    at = sign * 0.5 * np.eye(3)[axis]
                    at = at + (i / N - 0.5) * u + (j / N - 0.5) * v
                    vertices.append(tuple(float(x) for x in size * at))
                    owners.append(side)
            for j in range(N):
                for i in range(N):
                    a = first + j * (N + 1) + i
                    quad = [a, a + 1, a + N + 2, a + N + 1]
                    outward = (sign > 0) != inside_out
                    quads.append(quad if outward else quad[::-1])
                    sides.append(side)
        order = np.random.default_rng(seed).permutation(len(quads))
        self.vertices = vertices
        self.owner = np.array(owners)
        self.quads = [quads[i] for i in order]
        self.side = np.array(sides)[order]

    def write(self, folder: Path, name: str = "box.ply") -> Path:
        lines = [
            "ply", "format ascii 1.0", f"element vertex {len(self.vertices)}",
            "property double x", "property double y", "property double z",
            "property float paint", "property int owner",
            f"element face {len(self.quads)}",
            "property list uchar int vertex_indices", "property uchar painted",
            "property float nothing", "property float hole", "end_header",
        ]  # fmt: skip
        for (x, y, z), owner in zip(self.vertices, self.owner, strict=True):
            lines.append(f"{x!r} {y!r} {z!r} {int(owner == TOP)} {owner}")
        for quad, side in zip(self.quads, self.side, strict=True):
            corners = " ".join(map(str, quad))
            lines.append(f"{len(quad)} {corners} {3 * (side == TOP)} 0 nan")
        path = folder / name
        path.write_text("\n".join(lines) + "\n")
        return path

    def indices(self) -> np.ndarray:
        return np.flatnonzero(self.side == TOP)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("interest")
    block = QuadBox()
    block.write(folder)
    indices = block.indices()
    (folder / "top.txt").write_text("# the top\n" + "\n".join(map(str, indices)))
    (folder / "top.csv").write_text(", ".join(map(str, indices)) + "\n")
    (folder / "top.json").write_text(json.dumps(indices.tolist()))
    (folder / "twice.txt").write_text(" ".join(f"{i} {i}" for i in indices))
    np.save(folder / "top.npy", indices)
    np.save(folder / "top_bool.npy", block.side == TOP)
    weight = (block.owner == TOP).astype(float)
    (folder / "weight.txt").write_text("\n".join(map(str, weight)))
    np.save(folder / "weight.npy", weight)
    return folder


@pytest.fixture(scope="module")
def mesh(folder: Path) -> TriangleMesh:
    return load_mesh(folder / "box.ply", unit="mm")


def top_of(mesh: TriangleMesh) -> np.ndarray:
    return mesh.face_normals[:, 2] > 0.9


@pytest.mark.parametrize(
    ("kind", "source"),
    [
        ("select", "top.txt"),
        ("select", "top.csv"),
        ("select", "top.json"),
        ("select", "twice.txt"),
        ("select", "top.npy"),
        ("select", "top_bool.npy"),
        ("select", "ply:painted"),
        ("select", "ply:paint"),
        ("weight", "weight.txt"),
        ("weight", "weight.npy"),
        ("weight", "ply:paint"),
    ],
)
def test_the_same_target_however_it_is_given(
    kind: str, source: str, folder: Path, mesh: TriangleMesh
) -> None:
    path = None if source.startswith("ply:") else folder / source
    read = read_selection if kind == "select" else read_weight
    found = read(source if path is None else str(path), mesh)
    # Every quad of the top with both its triangles, and no other, seams or not.
    np.testing.assert_array_equal(found.chosen, top_of(mesh))
    assert found.chosen.sum() == 2 * N * N
    assert found.kind == ("faces" if kind == "select" else "vertex_weight")
    assert found.n_removed == 0
    digest = path and hashlib.sha256(path.read_bytes()).hexdigest()
    assert (found.source, found.sha256) == (str(path) if path else source, digest)


def test_arrays_in_memory_count_as_the_mesh_does(mesh: TriangleMesh) -> None:
    top = top_of(mesh)
    weight = np.zeros(len(mesh.vertices))
    weight[mesh.faces[top]] = 2.5
    for select in (top, np.flatnonzero(top), np.flatnonzero(top).tolist()):
        found = interest_of(mesh, select, None)
        assert found is not None
        np.testing.assert_array_equal(found.chosen, top)
        assert (found.kind, found.source) == ("faces", None)
    found = interest_of(mesh, None, weight)
    assert found is not None
    np.testing.assert_array_equal(found.chosen, top)
    assert found.kind == "vertex_weight"
    assert interest_of(mesh, None, None) is None
    assert interest_of(mesh, found, None) is found
    assert interest_of(mesh, None, found) is found


@pytest.mark.parametrize("inside_out", [False, True])
@pytest.mark.parametrize("seed", [1, 2])
def test_permuted_faces_with_permuted_indices_are_the_same_target(
    seed: int, inside_out: bool, tmp_path: Path
) -> None:
    other = QuadBox(seed, inside_out=inside_out)
    mesh = load_mesh(other.write(tmp_path), unit="mm")
    (tmp_path / "top.txt").write_text(" ".join(map(str, other.indices())))
    found = read_selection(str(tmp_path / "top.txt"), mesh)
    np.testing.assert_array_equal(found.chosen, top_of(mesh))
    regions = regions_of_faces(mesh, principal_curvatures(mesh), found.chosen)
    assert len(regions) == 1
    np.testing.assert_allclose(regions[0].mean_normal, [0, 0, 1], atol=1e-12)
    assert regions[0].area_m2 == pytest.approx(0.08 * 0.06, rel=1e-12)


def test_chosen_faces_that_repair_removed_are_counted(tmp_path: Path) -> None:
    block = QuadBox()
    n = len(block.quads)
    first = int(block.indices()[0])
    # A copy of a chosen quad, and one without area; both are chosen as well. Another
    # without area isn't, and doesn't count.
    block.quads += [list(block.quads[first]), [0, 1, 1, 0], [2, 3, 3, 2]]
    block.side = np.append(block.side, [TOP, TOP, 0])
    mesh = load_mesh(block.write(tmp_path), unit="mm")
    found = read_selection("ply:painted", mesh)
    np.testing.assert_array_equal(found.chosen, top_of(mesh))
    assert found.n_removed == 2
    only = tmp_path / "gone.txt"
    only.write_text(f"{n} {n + 1}")
    with pytest.raises(InputError, match="all 2 faces that it chooses were removed"):
        read_selection(str(only), mesh)


BAD_SELECTIONS = [
    ("0 96", r"face 96 isn't there, indices must lie in 0\.\.95; the first .* as 0"),
    ("-1", r"face -1 isn't there"),
    ("99999999999999999999", "'99999999999999999999' isn't a face index"),
    ("1.0 2.0", r"'1\.0' isn't a face index, must be a whole number from 0"),
    ("1 two", "'two' isn't a face index"),
    ("1_0", "'1_0' isn't a face index"),
    ("# nothing\n\n", "chooses no face"),
    (b"\xff\xfe\x00\x01", "isn't text"),
    (np.array([0.0, 1.0]), r"holds float64 \(2,\), must be a list of face indices"),
    (np.ones(95, bool), "holds 95 bools, must hold 96"),
    (np.zeros(96, bool), "chooses no face"),
    (np.array([[1, 2]]), r"holds int64 \(1, 2\)"),
    (b"\x93NUMPY broken", "isn't a usable .npy file"),
    ("ply:absent", "no face property 'absent'; it has: painted, nothing, hole; of"),
    ("ply:nothing", "chooses no face"),
    ("ply:hole", "value 0 is nan, must be a finite number"),
    (None, "can't be read .No such file or directory.; check the path"),
]
BAD_WEIGHTS = [
    ("1 2 3", "holds 3 weights, must hold 150, one for each vertex of the mesh file"),
    ("1 " * 149 + "-0.5", "the weight of vertex 149 is -0.5, must be a finite number"),
    ("nan " + "1 " * 149, "the weight of vertex 0 is nan"),
    ("0 " * 150, "no face has a weight above 0 at all its corners"),
    ("1 " * 149 + "x", "could not convert string to float: 'x'; a weight must"),
    (np.array(["a"] * 150), "holds <U1, must hold numbers"),
    (np.ones((150, 1)), "holds 150 x 1 weights, must hold 150"),
    ("ply:absent", "no vertex property 'absent'; it has: paint, owner"),
    ("ply:painted", "'painted' is one of faces: use --select ply:painted"),
]


@pytest.mark.parametrize(
    ("read", "content", "message"),
    [(read_selection, *bad) for bad in BAD_SELECTIONS]
    + [(read_weight, *bad) for bad in BAD_WEIGHTS],
)
def test_what_cannot_be_used_is_refused_in_one_line(
    read, content, message: str, mesh: TriangleMesh, tmp_path: Path
) -> None:
    where = content
    if not (isinstance(content, str) and content.startswith("ply:")):
        path = tmp_path / "given"
        where = str(path)
        if isinstance(content, np.ndarray):
            with path.open("wb") as file:
                np.save(file, content)
        elif content is not None:
            path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(InputError, match=message) as caught:
        read(where, mesh)
    assert str(caught.value).startswith(where)
    assert "\n" not in str(caught.value)


def test_a_mesh_without_properties_says_so(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 30 0 0\nv 0 30 0\nf 1 2 3\n")
    mesh = load_mesh(path)
    for read in (read_selection, read_weight):
        with pytest.raises(InputError, match="no properties, only PLY files"):
            read("ply:painted", mesh)


def test_a_vertex_property_must_paint_whole_faces(tmp_path: Path) -> None:
    block = QuadBox()
    mesh = load_mesh(block.write(tmp_path), unit="mm")
    assert read_selection("ply:owner", mesh).chosen.sum() == 2 * N * N * 5
    block.owner = np.where(np.arange(len(block.owner)) == 7, TOP, 0)
    mesh = load_mesh(block.write(tmp_path), unit="mm")
    with pytest.raises(InputError, match="no face has three corners where"):
        read_selection("ply:paint", mesh)


def test_weights_of_vertices_that_no_face_uses_do_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 30 0 0\nv 0 30 0\nv 9 9 9\nf 1 2 3\n")
    mesh = load_mesh(path)
    (tmp_path / "w").write_text("1 2 3 nan")
    assert read_weight(str(tmp_path / "w"), mesh).chosen.tolist() == [True]


def test_arrays_that_do_not_fit_are_refused() -> None:
    ball = sphere(0.1, subdivisions=1)
    n, n_vertices = len(ball.faces), len(ball.vertices)
    rig = load_rig("default")
    cases = [
        ({"select": [0], "weight": np.ones(n_vertices)}, "both fix the target"),
        ({"select": [0], "target": "surface"}, "both are targets: give one"),
        ({"weight": [1.0], "target": "surface"}, "both are targets: give one"),
        ({"select": [n]}, f"face {n} isn't there"),
        ({"select": []}, "chooses no face"),
        ({"select": np.ones(n + 1, bool)}, f"holds {n + 1} bools, must hold {n}"),
        ({"weight": np.ones(n)}, f"weight: holds {n} weights, must hold {n_vertices}"),
        ({"weight": np.full(n_vertices, np.nan)}, "is nan, must be a finite"),
        (
            {"select": interest_of(box((1.0, 1.0, 1.0)), [0], None)},
            f"the selection is of 12 faces, the mesh has {n}",
        ),
    ]
    for options, message in cases:
        with pytest.raises(InputError, match=message):
            plan_rig(ball, rig, max_projectors=1, **options)


# The whole way


@pytest.fixture(scope="module")
def plan(mesh: TriangleMesh, with_little_work) -> RigPlan:
    with with_little_work():
        return plan_rig(
            mesh,
            load_rig("default"),
            max_projectors=3,
            select=read_selection("ply:painted", mesh),
            check=False,
        )


def test_one_side_of_a_box_needs_one_projector(plan: RigPlan) -> None:
    surface = plan.surface
    np.testing.assert_array_equal(surface.region >= 0, top_of(surface.mesh))
    assert len(plan.projectors) == 1
    assert plan.to_document()["certificates"]["projectors"]["status"] == "optimal"
    assert plan.to_document()["coverage"]["target"]["area_m2"] == pytest.approx(
        0.0048, rel=1e-9
    )
    # It stands on the side that was chosen.
    assert plan.projectors[0].world_from_device[2, 3] > 0.5
    assert len(plan.to_document()["regions"]) == 1


def test_the_plan_says_who_chose_the_target(plan: RigPlan) -> None:
    # The box came in 2 N^2 triangles a side; they were cut, and chosen as before.
    n_faces = int(top_of(plan.surface.mesh).sum())
    assert n_faces > 2 * N * N
    assert plan.to_document()["surface"]["selection"] == {
        "kind": "faces",
        "source": "ply:painted",
        "sha256": None,
        "n_faces": n_faces,
        "area_m2": pytest.approx(0.0048, rel=1e-9),
        "n_removed_by_repair": 0,
    }
    assert plan.requirements.target == "dominant"
    text = summary(plan, [], ())
    assert "target (your selection)" in text
    assert f"1 region of your selection by ply:painted: {n_faces} faces" in text
    assert "dominant" not in text


def test_a_plan_for_a_selection_verifies_and_a_changed_one_does_not(
    plan: RigPlan,
) -> None:
    assert verify_plan(plan, seed=5, check_pixels=False).failures == ()
    surface = plan.to_document()["surface"]
    for key, value in (("n_faces", 31), ("area_m2", 0.0049), ("kind", "mood")):
        spoiled = surface | {"selection": surface["selection"] | {key: value}}
        document = plan.to_document() | {"surface": spoiled}
        found = audit_plan(
            RigPlan.from_document(document, plan.surface), n_samples=1000
        )
        assert [f for f in found.failures if f.startswith(f"surface.selection.{key}")]


# What lies outside


@pytest.fixture(scope="module")
def outside(with_little_work) -> RigPlan:
    """Of a ball in whose middle there is another one, all that can be seen."""
    outer, inner = sphere(0.05, subdivisions=3), sphere(0.03, subdivisions=3)
    hollow = joined(outer, flipped(inner))
    with with_little_work():
        return plan_rig(
            hollow,
            load_rig("default"),
            max_projectors=4,
            target="outside",
            dominant_coverage=0.3,
            coverage=0.5,
            region_coverage=0.0,
            check=False,
            on_miss="return",
        )


def test_what_lies_inside_is_left_out_of_the_target(outside: RigPlan) -> None:
    surface, document = outside.surface, outside.to_document()
    far = np.linalg.norm(surface.mesh.face_centroids, axis=1) > 0.04
    np.testing.assert_array_equal(surface.region >= 0, far)
    area = surface.mesh.face_areas[far].sum()
    assert document["coverage"]["target"]["area_m2"] == pytest.approx(area, rel=1e-9)
    assert document["coverage"]["unreachable_inside_m2"] == 0.0
    assert document["requirements"]["target"] == "outside"
    selection = document["surface"]["selection"]
    assert (selection["kind"], selection["source"]) == ("outside", None)
    text = summary(outside, [], ())
    assert "target (outside)" in text
    assert f"{len(document['regions'])} regions of the outside" in text
    assert "dominant" not in text


def test_a_plan_for_the_outside_verifies_and_another_target_does_not(
    outside: RigPlan,
) -> None:
    assert verify_plan(outside, seed=5, check_pixels=False).failures == ()
    assert of_surface(outside, EXACTLY) == ()
    (told,) = [line for line in of_surface(outside, "") if "target" in line]
    assert told.endswith("chosen by what lies outside, says surface.selection")
    differs = outside.surface.region.copy()
    differs[np.flatnonzero(differs >= 0)[0]] = -1
    for region, same in ((outside.surface.region, True), (differs, False)):
        stated = replace(outside, surface=replace(outside.surface, region=region))
        again = made_again(stated, threads=2)["surface"]["sha256"]
        assert (again == stated.surface.sha256()) == same
    # Other regions come out where it says that curvature chose them.
    document = outside.to_document()
    document["requirements"]["target"] = "dominant"
    document["surface"]["selection"] = None
    plan = RigPlan.from_document(document, outside.surface)
    again = made_again(plan, threads=2)
    assert "regions" not in again
    assert again["surface"]["sha256"] != plan.document.surface.sha256
    for kind, told in (
        ("faces", "outside"),
        ("outside", "dominant"),
        ("curvature", "outside"),
    ):
        document = outside.to_document()
        document["surface"]["selection"]["kind"] = kind
        if kind == "curvature":
            document["surface"]["selection"] = None
        document["requirements"]["target"] = told
        plan = RigPlan.from_document(document, outside.surface)
        found = audit_plan(plan, n_samples=1000).failures
        assert f"surface.selection.kind: is {kind!r}" in " ".join(found)


def in_process(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *words: object
) -> tuple[int, str, str]:
    monkeypatch.setattr(sys, "argv", ["plan", *map(str, words)])
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.setenv(name, "1")
    with pytest.raises(SystemExit) as caught:
        main()
    return caught.value.code or 0, *capsys.readouterr()


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["--select", "a", "--weight", "b"], 2, "--select or --weight, not both"),
        (["--select", "a", "--target", "surface"], 2, "--target surface or --select"),
        (["--weight", "a", "--target", "surface"], 2, "--target surface or --weight"),
        (["--select", "a", "--target", "outside"], 2, "--target outside or --select"),
        (["--select", ""], 2, "--select '' names no file"),
        (["--select", "absent.txt"], 3, "absent.txt: can't be read"),
        (["--select", "ply:absent"], 3, "no face property 'absent'"),
        (["--weight", "ply:painted"], 3, "use --select ply:painted"),
        (["--weight", "top.txt"], 3, "holds 16 weights, must hold 150"),
    ],
)
def test_exit_codes_and_one_line_errors(
    words, code, message, folder, tmp_path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(folder)
    base = ["--mesh", "box.ply", "--max-projectors", "2", "-o", tmp_path / "out"]
    found, out, err = in_process(monkeypatch, capsys, *base, "--quiet", *words)
    assert (found, out) == (code, "")
    assert message in err
    assert err.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("little_work")
@pytest.mark.long
def test_a_weight_on_the_command_line_ends_in_a_verified_plan(
    folder, tmp_path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(folder)
    base = ["--mesh", "box.ply", "--max-projectors", "2", "-o", tmp_path / "out"]
    words = ["--weight", "weight.txt", "--no-check", "--verbose"]
    code, out, err = in_process(monkeypatch, capsys, *base, *words)
    assert code == 0, err
    assert "weight.txt: 32 of 192 triangles are the target, 23.1% of the area" in err
    document = json.loads((tmp_path / "out" / "plan.json").read_text())
    selection = document["surface"]["selection"]
    n_faces = selection["n_faces"]
    assert n_faces > 32
    assert f"1 region of your highest weight by weight.txt: {n_faces} faces" in out
    assert (selection["kind"], selection["source"]) == ("vertex_weight", "weight.txt")
    digest = hashlib.sha256((folder / "weight.txt").read_bytes()).hexdigest()
    assert selection["sha256"] == digest
    words = ["verify", tmp_path / "out" / "plan.json", "--mesh", "box.ply"]
    code, out, _ = in_process(monkeypatch, capsys, *words)
    assert code == 0, out
    assert "every claim holds" in out
