"""Values that no option of `plan_rig` has are refused before any work, in one line."""

import numpy as np
import pytest
from support.plain_shapes import box

from planning import InputError, load_rig, plan_rig, prepare, sweep
from planning.steps.refused import check_values

NAN = float("nan")


@pytest.mark.parametrize(
    ("name", "values", "rule"),
    [
        ("on_miss", ["rasie", None], "one of raise, return"),
        ("cameras_by", ["zz", None, 3], "one of cover, paper, both"),
        ("ring_axis", ["zz"], "one of None, centred, free, auto"),
        ("align", ["zz"], "one of given, axes, icp"),
        ("joint", ["yes"], "one of True, False"),
        ("cache", [None, "folder"], "a Cache; leave it out to keep nothing"),
        ("threads", [0, -1, 1.5, "2"], "a whole number, 1 or more"),
        ("seed", [-1, 1.5, None, True], "a whole number, 0 or more"),
        ("max_projectors", [2.5, -1, "2"], "a whole number, 0 or more"),
        ("max_cameras", [2.5, True], "a whole number, 0 or more"),
        ("max_projectors", [10**23], "1000000 at most"),
        ("max_cameras", [2**54], "1000000 at most"),
        ("max_heads", [2**54], "1000000 at most"),
        ("views", [0, 1.5], "a whole number, 1 or more"),
        ("coverage", ["x", NAN, True], "a number"),
        ("accuracy_mm", ["x"], "a number"),
        ("time_limit", ["x", NAN], "a number"),
        ("time_limit", [0, -1.5], "more than 0 s"),
    ],
)
def test_a_wrong_value_is_named_with_what_it_must_be(monkeypatch, name, values, rule):
    def work(*_, **__):
        raise AssertionError("work was done before")

    monkeypatch.setattr("planning.pipeline.request_of", work)
    for value in values:
        asked = {"max_projectors": 1, name: value}
        with pytest.raises(InputError) as told:
            plan_rig(box((0.1, 0.06, 0.03)), load_rig(), **asked)
        assert str(told.value) == f"{name} = {value!r} must be {rule}"


MESH, RIG = box((0.1, 0.06, 0.03)), load_rig()


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("mesh", "part.obj", "'part.obj' must be a mesh from load_mesh"),
        ("mesh", ["part.obj"], "['part.obj'] must be a mesh from load_mesh"),
        ("mesh", None, "None must be a mesh"),
        ("mesh", MESH.vertices, "a ndarray must be a mesh"),
        ("mesh", (one for one in [MESH]), "must be a mesh from load_mesh, a list"),
        ("rig", "default", "'default' must be a Rig; load_rig reads one"),
        ("rig", None, "None must be a Rig"),
        ("fixed", "plan.json", "'plan.json' must be a Mounted; read_mounted"),
        ("take", (3, 4), "(3, 4) must be a TakenPoint"),
        ("progress", 5, "5 must be a function"),
        ("align", np.array(["icp", "axes"]), "must be one of given, axes, icp"),
        ("align", np.array(["icp"]), "must be one of given, axes, icp"),
    ],
)
def test_what_is_of_another_type_is_refused_with_where_to_get_one(name, value, told):
    asked = {"mesh": MESH, "rig": RIG, "max_projectors": 1, name: value}
    calls = [plan_rig]
    calls += [prepare] * (name in ("mesh", "rig"))
    for call in calls:
        with pytest.raises(InputError) as error:
            call(**asked)
        assert str(error.value).startswith(f"{name} = ")
        assert told in str(error.value)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"grid": {"coverage": 0.9}}, "grid['coverage'] = 0.9 must be a list"),
        ({"grid": {"target": "surface"}}, "grid['target'] = 'surface' must be a list"),
        ({"asked": {"on_miss": "raise"}}, "on_miss is sweep's own"),
        ({"grid": {"rig": [RIG]}}, "rig is sweep's own"),
        ({"mesh": "part.obj"}, "mesh = 'part.obj' must be a mesh"),
        ({"rig": "default"}, "rig = 'default' must be a Rig"),
    ],
)
def test_a_sweep_refuses_the_same(changed, told):
    asked = {"mesh": MESH, "rig": RIG, "grid": {}, "asked": {"max_projectors": 1}}
    with pytest.raises(InputError) as error:
        sweep(**(asked | changed))
    assert str(error.value).startswith(told)


def test_numbers_of_numpy_and_options_left_out_are_taken():
    check_values(
        {"max_projectors": np.int64(3), "coverage": np.float32(0.5), "seed": 0}
    )
    check_values(dict.fromkeys(("threads", "max_cameras", "coverage", "ring_axis")))
    check_values({"coverage": 1, "time_limit": np.inf, "joint": np.True_})
