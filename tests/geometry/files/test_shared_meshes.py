"""The twelve shared meshes: read as what they are, curved, divided, planned.

`benchmarks/plans/main_job.py` plans all of them with the default rig.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from geometry.curvature.curvature import principal_curvatures
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.regions.regions import dominant_regions

DATA = Path(__file__).resolve().parents[4] / "shared" / "data" / "meshes"
needs_shared = pytest.mark.skipif(
    not DATA.is_dir(), reason="the shared data lies beside the repository only"
)
NAMES = [
    "colin27_head_1mm.ply.gz",
    "face_scan_james.obj",
    "mediapipe_canonical_face_model.obj",
    "snowden_bust_lo.obj",
    "tm_ADIS16480.STL",
    "tm_counter.unitsmm.STL",
    "tm_fixed_top.ply",
    "tm_reference.obj",
    "vtk_Angel_decimated.ply",
    "vtk_bunny.ply",
    "vtk_horse.ply",
    "vtk_turbineblade.ply",
]
# Curvature and regions of larger ones: `benchmarks/plans/main_job.py`.
LARGE = 50_000


def bodies_and_border(mesh: TriangleMesh) -> tuple[int, int]:
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    n = len(mesh.vertices)
    _, counts = np.unique(edges[:, 0] * n + edges[:, 1], return_counts=True)
    links = coo_array((np.ones(len(edges)), edges.T), shape=(n, n))
    bodies = connected_components(links, directed=False)[0]
    return int(bodies), int((counts == 1).sum())


@needs_shared
def test_the_table_is_of_these_twelve(shared_meshes) -> None:
    assert [mesh.name for mesh in shared_meshes.MESHES] == NAMES
    assert {path.name for path in DATA.iterdir()} == set(NAMES)


@needs_shared
@pytest.mark.parametrize("name", NAMES)
def test_a_shared_mesh_is_read_as_what_it_is(name: str, shared_meshes) -> None:
    known = shared_meshes.BY_NAME[name]
    mesh = load_mesh(known.path, **known.options)
    assert len(mesh.faces) == known.faces
    assert bodies_and_border(mesh) == (known.bodies, known.border_edges)
    size = 1e3 * np.ptp(mesh.bounds, axis=0).max()
    assert size == pytest.approx(known.size_mm, rel=1e-4)
    assert mesh.source is not None
    # Nothing of any of them is lost: all are cleaner than they look.
    lost = {"zero-area faces removed", "non-finite faces removed"}
    assert not lost & {repair.kind for repair in mesh.source.repairs}
    if known.faces > LARGE:
        return
    field = principal_curvatures(mesh)
    found = dominant_regions(mesh, field)
    assert len(found.face_region) == len(mesh.faces)
    assert len(found.regions) > 0
    share = mesh.face_areas[found.face_region >= 0].sum() / mesh.area
    assert 0.05 < share < 0.5


@needs_shared
@pytest.mark.usefixtures("little_work")
@pytest.mark.parametrize("name", ["mediapipe_canonical_face_model.obj"])
def test_a_small_shared_mesh_goes_through_the_main_job(
    name: str, shared_meshes, small_job, tmp_path: Path
) -> None:
    known = shared_meshes.BY_NAME[name]
    ended = small_job.run(known.path, tmp_path, known.words)
    assert ended.code in (0, 1), ended.message
    assert ended.lines == 0, ended.message
    assert ended.plan is not None
    assert ended.plan["meshes"][0]["unit"] == "cm"
    assert ended.plan["meshes"][0]["n_faces"] == known.faces
    assert 1 <= len(ended.plan["projectors"]) <= 3
    assert ended.plan["regions"]
