"""A body without any dominant region, all of whose surface is the target."""

import pytest

from planning.model.plan import RigPlan
from planning.verify.audit.audit import audit_plan

# Two triangles a side, as other programs write a box.
_CORNERS = [(x, y, z) for x in (-50, 50) for y in (-50, 50) for z in (-0.05, 0.05)]
_SIDES = "241 521 143 351 284 625 682 483 753 387 765 867"


@pytest.mark.long
def test_a_plate_of_a_tenth_of_a_millimetre_bears_the_audit(
    small_job, tmp_path, with_little_work
):
    lines = [f"v {x} {y} {z}" for x, y, z in _CORNERS]
    lines += [f"f {' '.join(side)}" for side in _SIDES.split()]
    (tmp_path / "plate.obj").write_text("\n".join(lines))
    with with_little_work():
        words = ["--target", "surface", "--cameras-by", "cover"]
        ended = small_job.run(tmp_path / "plate.obj", tmp_path, words)
        assert ended.code == 0, ended.message
        plan = RigPlan.load(tmp_path / "plan" / "plan.json")
        assert not plan.surface.in_dominant.any()
        assert audit_plan(plan).failures == ()
