"""The typed plan: schema, what a file keeps, and faults of a file, a line each."""

import contextlib
import hashlib
import json
from importlib.resources import files

import numpy as np
import pytest
from click.testing import CliRunner

from planning.cli.main import commands
from planning.model.document.plan_document import PlanDocument, plan_schema
from planning.model.errors import PlanFileError
from planning.model.plan import RigPlan
from planning.model.surface import Surface


@pytest.fixture(scope="module")
def plan(handmade):
    return handmade.build_plan()


def test_the_shipped_schema_is_that_of_the_document():
    shipped = files("planning.model").joinpath("plan.schema.json").read_text()
    # A docstring changes it, too: write plan_schema() into that file.
    assert shipped == plan_schema()
    result = CliRunner().invoke(commands, ["schema"])
    assert result.exit_code == 0
    assert result.stdout == shipped
    assert json.loads(shipped)["properties"]["version"]["const"] == 1


def test_a_document_is_written_as_it_was_read(plan):
    text = plan.to_json()
    again = PlanDocument.read(text)
    assert json.dumps(again.to_document(), indent=1) + "\n" == text
    # Keys that were absent stay absent.
    assert "ranges" not in again.to_document()
    assert "given" not in again.to_document()["certificates"]["cameras"]


def test_keys_that_are_not_known_are_kept(plan):
    document = plan.to_document() | {"mood": "good"}
    document["projectors"][0]["colour"] = [1, 2]
    again = RigPlan.from_document(document, plan.surface).to_document()
    assert again["mood"] == "good"
    assert again["projectors"][0]["colour"] == [1, 2]


def test_parts_are_frozen_and_changes_are_validated(plan):
    proof = plan.document.certificates.cameras
    with pytest.raises(ValueError, match="frozen"):
        proof.count = 7
    assert proof.changed(count=7).count == 7
    assert proof.count == 2
    with pytest.raises(ValueError, match="count"):
        proof.changed(count="many")
    plan.to_document()["cameras"].clear()
    assert len(plan.document.cameras) == 2


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda d: d.pop("seed"), "seed is missing"),
        (lambda d: d.update(meshes=[]), "meshes = [] should have at least 1 item"),
        (lambda d: d["projectors"][0].update(K=None), "K is missing, diverging light"),
        (lambda d: d.update(seed="x"), "seed = 'x' should be a valid integer"),
        (lambda d: d["cameras"][0].pop("K"), "cameras.0.K is missing"),
        (lambda d: d["cameras"].append(None), "cameras.2 = None should be an object"),
        (lambda d: d.update(coverage=[]), "coverage = [] should be an object"),
        (
            lambda d: d["coverage"]["target"].update(lit_m2=float("nan")),
            "coverage.target.lit_m2 = nan should be a finite number",
        ),
        (
            lambda d: d["projectors"][0].update(ring_radii=[0.2, 0.1]),
            "must be 2 or more, rising from 0",
        ),
        (
            lambda d: d["requirements"]["workspace"].pop("centre"),
            "requirements.workspace.centre is missing",
        ),
        (lambda d: d.update(regions=None, units=3, created=5), "created = 5 should be"),
        (lambda d: d["certificates"].clear(), "certificates.cameras is missing"),
    ],
)
def test_a_broken_plan_is_refused_a_line_for_each_fault(
    plan, handmade, tmp_path, change, sentence
):
    path = handmade.save(plan, tmp_path)
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    with pytest.raises(PlanFileError) as caught:
        RigPlan.load(path)
    message = str(caught.value)
    assert sentence in message
    for line in message.splitlines():
        assert line.startswith(f"{path}: ")
        assert line.endswith("; plan again")
    result = CliRunner().invoke(commands, ["verify", str(path)])
    assert result.exit_code == 3


def _rewritten(folder, **changes):
    """The plan's arrays, some of them others, with a true digest."""
    path = folder / "surface.npz"
    with np.load(path) as archive:
        arrays = dict(archive) | changes
    np.savez_compressed(path, **arrays)
    plan_path = folder / "plan.json"
    document = json.loads(plan_path.read_text())
    document["surface"]["sha256"] = hashlib.sha256(path.read_bytes()).hexdigest()
    plan_path.write_text(json.dumps(document))
    return plan_path


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("region", np.array(["a", "b"])),
        ("region", np.zeros((4, 1), dtype=np.int64)),
        ("member", np.array(3)),
        ("steep", np.zeros((4, 3), dtype=complex)),
        ("reference_cameras", np.zeros((2, 4))),
        pytest.param(
            "reference_cameras",
            np.tile(np.eye(4, dtype=np.longdouble), (4, 1, 1)),
            marks=pytest.mark.skipif(
                np.can_cast(np.longdouble, float), reason="no wider floats here"
            ),
        ),
        ("faces", np.zeros((2, 3))),
    ],
)
def test_arrays_of_another_kind_or_shape_are_refused(
    handmade, plan, tmp_path, name, array
):
    handmade.save(plan, tmp_path)
    path = _rewritten(tmp_path, **{name: array})
    with pytest.raises(PlanFileError, match=rf"`{name}` must be .*, got .* of shape"):
        RigPlan.load(path)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", ["float16", "float32", ">f8"])
def test_narrower_floats_are_read_as_ours(handmade, plan, tmp_path, kind):
    handmade.save(plan, tmp_path)
    poses = plan.surface.reference_cameras.astype(kind)
    read = RigPlan.load(_rewritten(tmp_path, reference_cameras=poses)).surface
    assert read.reference_cameras.dtype == np.float64
    assert np.array_equal(read.reference_cameras, poses)


def test_a_surface_that_was_damaged_is_refused(handmade, plan, tmp_path):
    path = handmade.save(plan, tmp_path)
    surface = tmp_path / "surface.npz"
    whole = surface.read_bytes()
    for place in range(60, len(whole) - 60, len(whole) // 40):
        surface.write_bytes(whole[:place] + b"\xa5" * 4 + whole[place + 4 :])
        with pytest.raises(PlanFileError, match="its SHA-256 isn't the one"):
            RigPlan.load(path)
        # With a digest of the damaged file, numpy and zlib are what refuse it.
        with contextlib.suppress(PlanFileError):
            Surface.load(surface)
