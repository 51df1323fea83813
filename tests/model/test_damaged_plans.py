"""Damaged plans and surfaces end in an answer, never in a traceback.

`python -m benchmarks.plans.damaged` reads thousands.
"""

from collections import Counter

import pytest
from support.damaged_plans import outcome

from planning.model.errors import PlanFileError


def test_a_few_of_the_damaged_plans_are_refused_or_judged(tmp_path):
    ended = [outcome(tmp_path, 20_261_127, number) for number in range(60)]
    assert [each for each in ended if each[2].startswith("escaped")] == []
    kinds = Counter((kind, how) for kind, _, how in ended)
    assert kinds["plan.json", "refused"] > 15
    assert kinds["surface.npz", "refused"] > 15


def test_a_seed_that_no_stream_has_is_refused(handmade):
    def below_zero(document):
        document["seed"] = -1

    with pytest.raises(PlanFileError, match="seed = -1"):
        handmade.tampered(handmade.build_plan(), below_zero)
