"""The twelve meshes beside the repository: in which unit, and what is known of them."""

from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "data" / "meshes"


@dataclass(frozen=True)
class SharedMesh:
    """How a mesh is planned, and facts that its reading must give.

    Attributes:
        name: File name.
        words: What the command line is told: unit, size, up.
        unit: Unit in which it is read; None where the size is given.
        size_mm: Longest side of the bounding box as it is read.
        faces: Faces after repair.
        bodies: Connected components after welding.
        border_edges: Edges with one face.
    """

    name: str
    words: tuple[str, ...]
    unit: str | None
    size_mm: float
    faces: int
    bodies: int
    border_edges: int

    @property
    def path(self) -> Path:
        return FOLDER / self.name

    @property
    def options(self) -> dict[str, object]:
        """Keywords for load_mesh."""
        if self.unit is None:
            return {"size_mm": self.size_mm}
        return {"unit": self.unit}


# Unit and size of those whose files state none: from where they were published, else a
# size at which they fit the default rig.
MESHES = (
    SharedMesh("colin27_head_1mm.ply.gz", (), "mm", 213.03, 1_155_156, 1207, 0),
    SharedMesh("face_scan_james.obj", (), "mm", 321.24, 12_228, 6, 552),
    SharedMesh(
        "mediapipe_canonical_face_model.obj",
        ("--unit", "cm", "--up", "y"),
        "cm",
        153.33,
        898,
        1,
        36,
    ),
    SharedMesh("snowden_bust_lo.obj", ("--unit", "in"), "in", 235.16, 37_629, 4, 39),
    SharedMesh("tm_ADIS16480.STL", ("--unit", "m"), "m", 47.0, 7436, 1, 0),
    SharedMesh("tm_counter.unitsmm.STL", (), "mm", 304.8, 83_750, 6, 0),
    SharedMesh("tm_fixed_top.ply", (), "mm", 120.0, 4772, 1, 0),
    SharedMesh("tm_reference.obj", (), "mm", 187.78, 1610, 1, 80),
    SharedMesh(
        "vtk_Angel_decimated.ply", ("--size-mm", "300"), None, 300.0, 35_804, 1, 1413
    ),
    SharedMesh(
        "vtk_bunny.ply", ("--unit", "m", "--up", "y"), "m", 155.70, 69_451, 1, 223
    ),
    SharedMesh("vtk_horse.ply", ("--size-mm", "300"), None, 300.0, 96_966, 1, 0),
    SharedMesh(
        "vtk_turbineblade.ply", ("--size-mm", "300"), None, 300.0, 199_034, 1, 0
    ),
)
BY_NAME = {mesh.name: mesh for mesh in MESHES}
