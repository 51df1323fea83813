"""What made a plan is told apart by code, libraries and arithmetic."""

import pytest

from planning.model.document.made_with import MadeWith


def test_here_is_the_same_as_here():
    here = MadeWith.here()
    assert here == MadeWith.here()
    assert here.differs(MadeWith.here()) == ""
    assert {"python", "ringrig", "numpy", "embreex"} <= here.libraries.keys()


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"code": "0" * 64}, "another state of ringrig"),
        ({"arithmetic": "abacus"}, "another processor"),
        ({"libraries": {}}, "python none, here "),
    ],
)
def test_what_is_different_is_told(changed, told):
    there = MadeWith.here().changed(**changed)
    assert there.differs(MadeWith.here()).startswith(told)
