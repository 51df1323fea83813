"""The twelve meshes beside the repository: in which unit, and what is known of them."""

from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[2] / "shared" / "data" / "meshes"


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
