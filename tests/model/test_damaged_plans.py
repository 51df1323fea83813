"""Damaged plans and surfaces end in an answer, never in a traceback.

`python -m benchmarks.plans.damaged` reads thousands.
"""

from collections import Counter
from io import BytesIO
from zipfile import ZipFile

import numpy as np
import pytest
from support.damaged_plans import outcome

from planning.model import packed_arrays
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


def test_what_unpacks_to_far_more_than_it_takes_is_refused(monkeypatch):
    monkeypatch.setattr(packed_arrays, "_LEAST", 10_000)
    buffer = BytesIO()
    np.savez_compressed(buffer, some=np.zeros(1_000_000))
    with pytest.raises(PlanFileError, match=r"unpacks to 80\d{5} bytes, at most"):
        packed_arrays.unpacked_arrays(buffer.getvalue())
    plain = BytesIO()
    np.savez_compressed(plain, some=np.arange(10_000.0))
    (some,) = packed_arrays.unpacked_arrays(plain.getvalue()).values()
    np.testing.assert_array_equal(some, np.arange(10_000.0))


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("name", ["some.npy", "some"])
def test_two_arrays_of_one_name_are_refused(name):
    """One reader takes the first of them, another the last."""
    buffer, other = BytesIO(), BytesIO()
    np.savez_compressed(buffer, some=np.zeros(3))
    np.save(other, np.ones(3))
    with ZipFile(buffer, "a") as archive:
        archive.writestr(name, other.getvalue())
    with pytest.raises(PlanFileError, match="two of its arrays have one name"):
        packed_arrays.unpacked_arrays(buffer.getvalue())
