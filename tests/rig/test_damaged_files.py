"""Damaged rig files and plans: exit 3 with every fault, and never a traceback.

`python -m benchmarks.rigs.mutated_files` reads ten times as many.
"""

import pytest
from support.damaged_files import cases, outcome


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
