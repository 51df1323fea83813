"""What is said of an object before anything is planned: its size, and what suits it."""

from collections.abc import Iterator

from geometry.mesh.mesh import TriangleMesh
from planning.report.summary.summary import body_words
from planning.rig.devices.lens_fit import optics_notes
from planning.rig.rig import Rig


def size_lines(mesh: TriangleMesh) -> Iterator[str]:
    """Yield size and unit, what was repaired, and how many bodies there are."""
    source = mesh.source
    if source is not None:
        x, y, z = (mesh.bounds[1] - mesh.bounds[0]) * 1e3
        scale = f"unit {source.unit}"
        if source.unit == "size_mm":
            scale = "scaled by --size-mm"
        yield (
            f"{source.path}: {x:.1f} x {y:.1f} x {z:.1f} mm ({scale}), "
            f"{len(mesh.faces)} faces"
        )
        for repair in source.repairs:
            yield f"  repaired: {repair.kind}, {repair.count}"
    if bodies := body_words(mesh):
        yield f"  {bodies}: all are planned for"


def optics_lines(rig: Rig, mesh: TriangleMesh) -> list[str]:
    """Return lines on devices: what to know of them, and what they leave unused."""
    notes = (*rig.notes(), *optics_notes(rig.fits(mesh)))
    return [f"  {note}" for note in notes]
