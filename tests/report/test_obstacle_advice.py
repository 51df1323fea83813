"""Advice names the obstacle that is in the way."""

import pytest
from support.factories import EXACT
from support.plain_shapes import box as plate_of

from planning import RequirementError, load_rig, plan_rig

LID = (
    '[[obstacle]]\nname = "lid"\nshape = "box"\ncentre_mm = [0, 0, 300]\n'
    "size_mm = [1500, 1500, 10]\n"
    '[[obstacle]]\nname = "post"\nshape = "cylinder"\ncentre_mm = [700, 0, 0]\n'
    "radius_mm = 10\nheight_mm = 300\n"
)
FEW = EXACT + (
    "[placement]\nn_candidate_projectors = 600\nn_reference_projectors = 600\n"
    "n_candidate_cameras = 400\nn_reference_cameras = 400\n"
)


@pytest.mark.long
def test_where_too_little_can_be_lit_the_obstacle_in_the_way_is_named(
    tmp_path, with_little_work
):
    """A lid over a plate keeps all light off its upper side; a post is harmless."""
    path = tmp_path / "rig.toml"
    path.write_text(f'base = "default"\n{LID}{FEW}')
    try:
        with with_little_work():
            plan_rig(
                plate_of((0.1, 0.1, 0.01), divisions=4),
                load_rig(path),
                max_projectors=2,
                target="surface",
                cameras_by="cover",
                check=False,
            )
    except RequirementError as missed:
        (reach,) = (text for text in missed.shortfalls if "--min-reachable" in text)
        coverage = missed.plan.coverage
    assert "behind an obstacle" in reach
    assert "obstacle 'lid' out of the way" in reach
    assert "post" not in reach
    areas = coverage.blocked_by_obstacle_m2
    assert areas["lid"] > 0.4 * coverage.target.area_m2
    assert areas["post"] < 0.01 * coverage.target.area_m2
