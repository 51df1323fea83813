"""Eight meshes under each pattern: counts, bounds, coverage, check and audit.

Usage: python -m benchmarks.plans.patterns [NAME ...]   (ringrig installed, from a
    checkout)

Plans meshes of `../shared/data/meshes` (those named, if any), each in the unit or size
that `tests/support/shared_meshes.py` states, with as many projectors as it takes. The
columns are those of `benchmarks.plans.main_job`.
"""

import sys

from support import shared_meshes

from .main_job import run

_MESHES = (
    *("face_scan_james.obj", "mediapipe_canonical_face_model.obj"),
    *("snowden_bust_lo.obj", "tm_ADIS16480.STL", "tm_counter.unitsmm.STL"),
    *("tm_reference.obj", "vtk_bunny.ply", "vtk_horse.ply"),
)
_PATTERNS, _MANY = ("rings", "dense"), 12


def main(names: list[str]) -> int:
    """Print the table; return 1 if a run ended without a documented exit code."""
    print(
        "| mesh | pattern | exit | faces | longest side [mm] | regions | wall [s] "
        "| projectors (bound) | cameras (bound) | lit | measured | rms [mm] | missing "
        "| difference to the audit |"
    )
    print("|" + 14 * "---|")
    codes: list[int] = []
    for mesh in shared_meshes.MESHES:
        if mesh.name not in (names or _MESHES):
            continue
        for pattern in _PATTERNS:
            words = (*mesh.words, "--pattern", pattern)
            code, row, _ = run(mesh.path, words, pattern, most=_MANY)
            codes.append(code)
            print(row, flush=True)
    return int(any(code not in (0, 1, 4) for code in codes))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
