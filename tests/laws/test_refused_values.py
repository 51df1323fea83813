"""Values that no option of `plan_rig` has are refused before any work, in one line."""

import numpy as np
import pytest
from support.plain_shapes import box

from planning import InputError, load_rig, plan_rig
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
        ("views", [0, 1.5], "a whole number, 1 or more"),
        ("coverage", ["x", NAN, True], "a number"),
        ("accuracy_mm", ["x"], "a number"),
        ("time_limit", ["x", NAN], "a number"),
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


def test_numbers_of_numpy_and_options_left_out_are_taken():
    check_values(
        {"max_projectors": np.int64(3), "coverage": np.float32(0.5), "seed": 0}
    )
    check_values(dict.fromkeys(("threads", "max_cameras", "coverage", "ring_axis")))
    check_values({"coverage": 1, "time_limit": np.inf, "joint": np.True_})
