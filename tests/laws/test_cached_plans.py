"""A plan is the same with a cache and without, whatever is found in it."""

import numpy as np
import pytest
from support.plain_shapes import box

from geometry.curvature import curvature
from geometry.files.archives import file_bytes
from planning import Cache, InputError, load_mesh, load_rig, plan_rig, prepare
from planning.handover.handed_plan import HandedPlan
from planning.steps.recalled_mesh import recalled_mesh

# Nothing here is about the number of samples.
pytestmark = pytest.mark.usefixtures("least_work")

ROOM = """
[camera.body]
size_mm = [60, 60, 150]
centre_mm = [0, 0, -50]
[[existing]]
name = "wall camera"
kind = "camera"
position_mm = [250, -1120, 100]
aim_mm = [0, 0, 0]
"""
# What a run says of itself.
ITS_OWN = ("created", "command", "timings_s")
DEAR = (
    *("prepare.principal_curvatures", "prepare.dominant_regions"),
    *("recalled.plan_projectors", "recalled.prove_fewest", "recalled.widen_margins"),
)


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    folder, shape = tmp_path_factory.mktemp("block"), box((0.1, 0.06, 0.03))
    lines = [f"v {x} {y} {z}" for x, y, z in 1e3 * shape.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in shape.faces + 1]
    (folder / "block.obj").write_text("\n".join(lines))
    return folder / "block.obj"


def _same(one, other):
    for plan in (one, other):
        for name in ITS_OWN:
            plan.pop(name)
        plan["cost"] = {
            k: v for k, v in plan["cost"].items() if k[0] not in "tC" and k[-2:] != "_s"
        }
    assert one == other


def _refuse(patch, names):
    for name in names:

        def asked(*_, name=name):
            raise AssertionError(f"{name} was asked again")

        patch.setattr(f"planning.steps.{name}", asked)


@pytest.mark.long
@pytest.mark.parametrize("room", ["", ROOM])
def test_the_command_finds_what_an_earlier_run_left_and_plans_the_same(
    small_job, tmp_path, monkeypatch, block, room
):
    monkeypatch.setattr(small_job, "RIG", small_job.RIG + room)

    def planned(*words):
        asked = ["--target", "surface", "--dominant-coverage", "0.6", *words]
        ended = small_job.run(block, tmp_path, asked)
        assert ended.code == 0, ended.message
        return ended.plan, (tmp_path / "plan" / "surface.npz").read_bytes()

    other = ("--coverage", "0.9")
    bare = planned("--no-cache"), planned(*other, "--no-cache")
    monkeypatch.setenv("RINGRIG_CACHE", str(tmp_path / "cache"))
    first = planned()
    with pytest.MonkeyPatch.context() as patch:
        _refuse(patch, [*DEAR, "recalled_mesh.mesh_of_bytes"])
        second = planned(*other)
    for (plan, surface), (cached, kept) in zip(bare, (first, second), strict=True):
        _same(plan, cached)
        assert surface == kept
    assert "cache" not in str(second[0]).replace(str(tmp_path), "")


def test_a_file_that_moved_or_changed_is_told_as_it_is(tmp_path, block, monkeypatch):
    cache, moved = Cache.in_memory(), tmp_path / "moved.obj"
    text = block.read_text()
    moved.write_text(text)

    def read(path, **how):
        return recalled_mesh(path, cache, **({"unit": None, "size_mm": None} | how))

    first = read(block)
    with monkeypatch.context() as patch:
        _refuse(patch, ["recalled_mesh.mesh_of_bytes"])
        second = read(moved)
    assert (first.source.path, second.source.path) == (str(block), str(moved))
    assert first.source.sha256 == second.source.sha256
    np.testing.assert_array_equal(first.vertices, second.vertices)
    np.testing.assert_array_equal(first.origin.corners, second.origin.corners)
    assert read(block, unit="cm").size == pytest.approx(10.0 * first.size)
    moved.write_text(text.replace("v -", "v -1", 1))
    assert read(moved).size > 1.5 * first.size


def test_a_file_saved_while_it_is_read_leaves_no_other_mesh(
    tmp_path, block, monkeypatch
):
    path, text, cache = tmp_path / "a.obj", block.read_text(), Cache.in_memory()
    path.write_text(text)

    def saved_afterwards(path):
        data = file_bytes(path)
        path.write_text(text.replace("v -", "v -1", 1))
        return data

    with monkeypatch.context() as patch:
        patch.setattr("planning.steps.recalled_mesh.file_bytes", saved_afterwards)
        first = recalled_mesh(path, cache, unit=None, size_mm=None)
    path.write_text(text)
    again = recalled_mesh(path, cache, unit=None, size_mm=None)
    assert first.source == again.source == load_mesh(path).source
    np.testing.assert_array_equal(first.vertices, again.vertices)


@pytest.mark.long
def test_a_prepared_planner_answers_as_plan_rig_does(rig):
    mesh = box((0.1, 0.06, 0.03))
    asked = {"max_projectors": 3, "target": "surface", "dominant_coverage": 0.6}
    asked |= {"check": False, "cameras_by": "cover", "on_miss": "return"}
    planner = prepare(mesh, rig, coverage=0.95, **asked)
    assert planner.plan().requirements.coverage == 0.95
    with pytest.MonkeyPatch.context() as patch:
        _refuse(patch, DEAR)
        plan = planner.plan(coverage=0.9)
    bare = plan_rig(mesh, rig, coverage=0.9, **asked)
    assert isinstance(plan, HandedPlan)
    _same(plan.to_document(), bare.to_document())


def test_a_plan_of_no_devices_says_which_options_give_some(rig):
    with pytest.raises(InputError, match=r"with max_projectors, or max_heads") as told:
        prepare(box((0.1, 0.06, 0.03)), rig).plan(coverage=0.98)
    with pytest.raises(TypeError, match="'max_projector'"):
        prepare(box((0.1, 0.06, 0.03)), rig, max_projector=2)
    assert "\n" not in str(told.value)


@pytest.mark.long
def test_another_rig_finds_nothing_of_the_first(rig):
    cache = Cache.in_memory()
    asked = {"max_projectors": 3, "target": "surface", "dominant_coverage": 0.6}
    asked |= {"check": False, "cameras_by": "cover", "on_miss": "return"}
    other = rig.replace(limits={"projector_max_incidence_deg": 50.0})
    plan_rig(box((0.1, 0.06, 0.03)), rig, cache=cache, **asked)
    cached = plan_rig(box((0.1, 0.06, 0.03)), other, cache=cache, **asked)
    with pytest.MonkeyPatch.context() as patch:
        # The report draws the curvatures that were found.
        patch.setattr(curvature, "_curvatures", None)
        assert curvature.principal_curvatures(cached.surface.mesh).valid.size
    bare = plan_rig(box((0.1, 0.06, 0.03)), other, **asked)
    _same(cached.to_document(), bare.to_document())


@pytest.fixture(scope="module")
def rig(small_job, tmp_path_factory):
    path = tmp_path_factory.mktemp("rig") / "few.toml"
    path.write_text(small_job.RIG)
    return load_rig(path)
