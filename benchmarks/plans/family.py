"""One rig for a family: 24 generated heads, and six real faces and busts.

Usage: python -m benchmarks.plans.family [heads|real] [N]   (ringrig installed, from a
    checkout)

Heads are those of `plan sample --family N` (24); real ones lie in
`../shared/data/meshes`, each in the unit or size that `tests/support/shared_meshes.py`
states, laid over the first by ICP; of them all that lies outside is the target, since
two are hollow. Every member's shares are of fresh samples; "alone" is what it takes for
itself of the family's candidates. Last come the family's counts with their bounds, and
the false claims that the audit found.
"""

import sys
import time
from collections.abc import Iterator

from support.shared_meshes import BY_NAME

from geometry.files.readers import load_mesh
from geometry.mesh.mesh import TriangleMesh
from geometry.shapes.sample_head.head_shape import HeadShape
from geometry.shapes.sample_head.sample_head import sample_head
from planning.model.document.family_records import AlignedBy
from planning.model.document.plan_document import MemberRecord
from planning.model.requirements import Requirements
from planning.pipeline import plan_rig
from planning.report.summary.family_lines import (
    family_bounds,
    family_heads,
    family_rows,
)
from planning.rig.rig import load_rig
from planning.rig.wishes import TargetName

from .main_job import audited

_REAL = (
    *("snowden_bust_lo.obj", "face_scan_james.obj", "vtk_Angel_decimated.ply"),
    *("colin27_head_1mm.ply.gz", "mediapipe_canonical_face_model.obj"),
)
_HEADS = 24
_MOST_PROJECTORS = 12
_EQUAL = 1.0 - 1e-9


def main(words: list[str]) -> int:
    """Print the tables; return 1 if a member falls short or a claim is false."""
    n = next((int(word) for word in words if word.isdigit()), _HEADS)
    kinds = [word for word in words if not word.isdigit()] or ["heads", "real"]
    well = True
    for kind in kinds:
        meshes = list(_heads(n) if kind == "heads" else _real())
        align: AlignedBy = "given" if kind == "heads" else "icp"
        well &= _told(kind, meshes, align, "dominant" if kind == "heads" else "outside")
    return int(not well)


def _told(
    kind: str, meshes: list[TriangleMesh], align: AlignedBy, target: TargetName
) -> bool:
    begin = time.monotonic()
    plan = plan_rig(
        meshes,
        load_rig("default"),
        align=align,
        max_projectors=_MOST_PROJECTORS,
        target=target,
        on_miss="return",
    )
    seconds = time.monotonic() - begin
    what = f"{kind}, align {align}, target {target}"
    print(f"\n{len(meshes)} members ({what}), {seconds:.0f} s\n")
    print("| " + " | ".join(family_heads()) + " |")
    print("|" + len(family_heads()) * "---|")
    for row in family_rows(plan):
        print("| " + " | ".join(row.cells) + " |")
    for line in family_bounds(plan):
        print(f"\n{line}.")
    asked = plan.requirements
    short = [record.name for record in plan.document.members if not _met(record, asked)]
    print(f"\nMembers whose coverage isn't met on fresh samples: {short or 'none'}.")
    false = sum(audited(member)[0] for member in plan.members)
    print(f"False claims of members: {false}.", flush=True)
    return not short and not false


def _met(record: MemberRecord, asked: Requirements) -> bool:
    areas = record.coverage.target
    lit = asked.dominant_coverage * areas.reachable_by_projectors_m2
    measured = asked.coverage * areas.reachable_by_cameras_m2
    return areas.lit_m2 >= _EQUAL * lit and areas.measured_m2 >= _EQUAL * measured


def _heads(n: int) -> Iterator[TriangleMesh]:
    for member in range(n):
        yield sample_head(HeadShape.of_family(0, member), open_neck=True)


def _real() -> Iterator[TriangleMesh]:
    for name in _REAL:
        mesh = BY_NAME[name]
        yield load_mesh(mesh.path, **mesh.options)
    # The sixth: the average adult.
    yield sample_head(open_neck=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
