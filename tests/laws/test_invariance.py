"""A rigid motion of the mesh moves the plan; another unit changes nothing."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.little_work import bound_roughly, draw_fewer, offer_fewer, search_briefly

from geometry.shapes.sample_head.sample_head import sample_head
from planning import load_mesh, load_rig, plan_rig

pytestmark = pytest.mark.long

# Up z becomes up -y, with a turn about it: not a symmetry of any world lattice.
TURN = (
    Rotation.from_rotvec([np.pi / 2, 0, 0]) * Rotation.from_rotvec([0, 0, 0.7])
).as_matrix()
SHIFT_M = np.array([100.0, -100.0, 100.0])


# About the vertical, whichever it is; a few devices move like any number.
RIG = """
base = "default"
name = "above"
[workspace]
shape = "cone"
axis = {axis}
half_angle_deg = 65.0
[requirements]
dominant_coverage = 0.6
region_coverage = 0.0
coverage = 0.8
min_reachable = 0.3
[placement]
n_candidate_projectors = 600
n_candidate_cameras = 400
n_reference_projectors = 600
n_reference_cameras = 400
"""


def planned(path, unit, up):
    rig = path.with_suffix(".toml")
    rig.write_text(RIG.format(axis={"z": [0, 0, 1], "-y": [0, -1, 0]}[up]))
    mesh = load_mesh(path, unit=unit)
    return plan_rig(mesh, load_rig(rig), max_projectors=4, up=up, check=False)


@pytest.fixture(scope="module")
def head():
    return sample_head(n_faces=5000)


@pytest.fixture(scope="module")
def plans(head, tmp_path_factory):
    """The plan of a file in mm, and of one in um, turned and 10^5 mm away.

    With fewer samples to move devices on, rounding decides between places.
    """
    folder = tmp_path_factory.mktemp("meshes")
    moved = head.vertices @ TURN.T + SHIFT_M
    found = []
    for name, vertices, unit, up in (
        ("still.off", head.vertices * 1e3, "mm", "z"),
        ("moved.off", moved * 1e6, "um", "-y"),
    ):
        path = folder / name
        rows = [" ".join(map(repr, row)) for row in vertices.tolist()]
        rows += [f"3 {a} {b} {c}" for a, b, c in head.faces.tolist()]
        head_line = f"OFF\n{len(vertices)} {len(head.faces)} 0"
        path.write_text("\n".join([head_line, *rows]) + "\n")
        with pytest.MonkeyPatch.context() as patch:
            draw_fewer(patch, claims=3000, overlaps=3000)
            bound_roughly(patch)
            search_briefly(patch)
            offer_fewer(patch)
            found.append(planned(path, unit, up))
    return found


def test_counts_bounds_and_regions_stay(plans):
    still, moved = (p.to_document() for p in plans)
    for kind in ("projectors", "cameras"):
        a, b = still["certificates"][kind], moved["certificates"][kind]
        assert (a["count"], a["status"], a["candidates"]) == (
            b["count"],
            b["status"],
            b["candidates"],
        )
        assert a["required_m2"] == pytest.approx(b["required_m2"], rel=1e-6)
    np.testing.assert_array_equal(plans[0].surface.region, plans[1].surface.region)


def test_every_area_stays(plans):
    for part in ("target", "surface"):
        still, moved = (p.to_document()["coverage"][part] for p in plans)
        for key, area in still.items():
            assert moved[key] == pytest.approx(area, abs=2e-3 * still["area_m2"]), key


def test_every_device_moves_along(plans):
    still, moved = plans
    for before, after in (
        *zip(still.projectors, moved.projectors, strict=True),
        *zip(still.cameras, moved.cameras, strict=True),
    ):
        a, b = before.world_from_device, after.world_from_device
        np.testing.assert_allclose(
            b[:3, 3], TURN @ a[:3, 3] + SHIFT_M, atol=1e-3, err_msg=before.id
        )
        np.testing.assert_allclose(
            b[:3, :3], TURN @ a[:3, :3], atol=2e-3, err_msg=before.id
        )
