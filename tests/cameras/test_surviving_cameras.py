"""Cameras that measure more than once: what the plan says of other numbers of them."""

import numpy as np
import pytest
from support.factories import FEW_CANDIDATES
from support.plain_shapes import grid, joined

from geometry.mesh.mesh import TriangleMesh
from planning import load_rig, plan_rig, verify_plan

RIG = f"""{FEW_CANDIDATES}[limits]
projector_max_incidence_deg = 50.0
camera_max_incidence_deg = 50.0
[requirements]
min_reachable = 0.5
"""
# Three plates of 80, 60 and 60 mm by 100 mm that face apart.
WIDTHS, DIRECTIONS = (0.08, 0.06, 0.06), (0.0, 120.0, 240.0)


def plates() -> TriangleMesh:
    """Each device measures one plate alone; they stand upright about z."""
    placed: list[TriangleMesh] = []
    for width, degrees in zip(WIDTHS, np.radians(DIRECTIONS), strict=True):
        flat = grid(width, 0.1, divisions=(6, 8))
        x, z, _ = flat.vertices.T
        c, s = np.cos(degrees), np.sin(degrees)
        turn = np.array([[-s, c, 0.0], [0.0, 0.0, 1.0], [c, s, 0.0]])
        points = np.column_stack([x, z, np.full(len(x), 0.04)])
        placed.append(TriangleMesh(points @ turn, flat.faces))
    return joined(*placed)


@pytest.mark.long
def test_fewer_cameras_are_never_said_to_measure_more(tmp_path, little_work):
    """Four that measure twice leave out a plate; three that measure once don't."""
    path = tmp_path / "few.toml"
    path.write_text(RIG)
    plan = plan_rig(
        plates(),
        load_rig(path),
        max_projectors=3,
        max_cameras=4,
        views=2,
        target="surface",
        cameras_by="cover",
        check=False,
        on_miss="return",
        threads=1,
    )
    areas = plan.coverage.target
    assert (len(plan.projectors), len(plan.cameras)) == (3, 4)
    assert areas.lit_m2 == pytest.approx(areas.area_m2, rel=0.05)
    assert areas.measured_m2 == pytest.approx(0.7 * areas.area_m2, rel=0.05)
    # Three are enough to measure all of it once.
    once = plan.document.certificates.cameras.by_count[-1]
    assert (once.count, once.value_m2) == (3, pytest.approx(areas.area_m2, rel=0.05))
    cameras = [row for row in plan.document.marginal if row.number[0] == "camera"]
    measured = [row.measured_target_m2 for row in cameras]
    assert measured == sorted(measured)
    assert verify_plan(plan, check_pixels=False, threads=1).failures == ()
