"""Damaged rig files and plans: exit 3 with every fault, and never a traceback.

`python -m benchmarks.rigs.mutated_files` reads ten times as many.
"""

import json

import pytest
from support.damaged_files import Case, cases, outcome
from support.handmade import build_plan


@pytest.mark.parametrize("kind", ["rig", "plan"])
def test_a_tenth_of_the_damaged_files_end_as_they_should(kind, tmp_path):
    found = [
        (case.damage, outcome(case, tmp_path))
        for case in cases(range(20))
        if case.kind == kind
    ]
    assert len(found) == 10
    assert [each for each in found if each[1].is_bad] == []
    assert sum(end.code == 3 for _, end in found) >= 7


def test_every_fault_of_a_plan_is_a_line(tmp_path):
    document = build_plan().to_document()
    document["projectors"][0]["range_m"] = "far"
    document["cameras"][1]["K"] = None
    del document["seed"]
    case = Case("plan", "three faults", json.dumps(document).encode())
    found = outcome(case, tmp_path)
    assert found.code == 3
    for line, key in zip(
        found.told.splitlines(), ("seed", "range_m", "cameras.1.K"), strict=True
    ):
        assert key in line
