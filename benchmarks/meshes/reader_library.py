"""Hold the strict readers against the library that could have read the files.

Usage: python -m benchmarks.meshes.reader_library   (ringrig installed, from a checkout)

Every file that `tests/geometry/files/test_reader_traps.py` makes, as it is made, and
every one of `../shared/data/nasty` is read by `geometry.files.readers` and by trimesh
(as a scene, all bodies, without its processing). Counts which come out as the same
surface: the same triangles, or else the same area and bounding box. Where they don't,
the tests say what is true: those of the traps give areas and boxes computed by hand, or
what is damaged.
"""

import contextlib
import importlib.metadata
import importlib.util
import io
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from benchmarks.machine import machine
from geometry.files.readers import load_mesh
from geometry.mesh.mesh import MeshError
from tests.geometry.files import test_nasty

TESTS = Path(__file__).resolve().parents[2] / "tests"
OUTCOMES = (
    "same surface",
    "library: other surface, silently",
    "library refuses or crashes, file is whole",
    "library reads what is damaged or no surface",
    "both refuse",
    "refused for its size only",
)


def main() -> int:
    """Print the counts and the files that come out differently."""
    version = importlib.metadata.version("trimesh")
    print(f"{machine()}, trimesh {version}\n")
    nasty = test_nasty
    sets = {"traps": _traps(nasty)}
    if nasty.NASTY.is_dir():
        files = sorted(nasty.NASTY.iterdir())
        sets["nasty"] = [_compare(nasty, path, {}) for path in files]
    print("| outcome |", " | ".join(sets), "|\n|---|" + "---|" * len(sets))
    counts = {name: Counter(o for o, _ in found) for name, found in sets.items()}
    for outcome in OUTCOMES:
        row = " | ".join(str(counts[name][outcome]) for name in sets)
        print(f"| {outcome} | {row} |")
    print("| files |", " | ".join(str(len(found)) for found in sets.values()), "|")
    for outcome in OUTCOMES[1:4]:
        print(f"\n{outcome}:\n")
        for name, found in sets.items():
            said = Counter(words for o, words in found if o == outcome)
            for words, number in sorted(said.items()):
                print(f"- {name}: {words}" + f" ({number} files)" * (number > 1))
    return 0


def _traps(nasty: ModuleType) -> list[tuple[str, str]]:
    """Run the tests of the traps; compare every file at the moment they read it."""
    found: list[tuple[str, str]] = []

    class Watch:
        def __init__(self) -> None:
            self.test = ""

        def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
            for item in items:
                item.module.load_mesh = self.watched  # type: ignore[attr-defined]

        def pytest_runtest_setup(self, item: pytest.Item) -> None:
            self.test = item.name.partition("[")[0]

        def watched(self, path: Path, **options: object) -> object:
            outcome, words = _compare(nasty, path, options)
            # A test's own name says more than that of its scratch file.
            words = f"{self.test}: {words.partition(': ')[2]}"
            found.append((outcome, words))
            return load_mesh(path, **options)  # type: ignore[arg-type]

    silent = io.StringIO()
    with contextlib.redirect_stdout(silent):
        code = pytest.main(
            [str(TESTS / "test_reader_traps.py"), "-q", "-p", "no:cacheprovider"],
            plugins=[Watch()],
        )
    if code:
        raise SystemExit(silent.getvalue())
    return found


def _compare(
    nasty: ModuleType, path: Path, options: dict[str, object]
) -> tuple[str, str]:
    """Return the outcome for one file, and what there is to say about it."""
    other = None
    try:
        other = np.asarray(nasty.library(path).triangles, dtype=np.float64)
        said = f"{len(other)} faces"
    except Exception as error:  # whatever a library raises is an answer here
        said = f"{type(error).__name__}: {' '.join(str(error).split())[:80]}"
    try:
        mesh = load_mesh(path, **options)  # type: ignore[arg-type]
    except MeshError as error:
        if "must be 1 mm to 100 m" in str(error):
            return OUTCOMES[5], path.name
        reads = other is not None and len(other) > 0
        why = str(error).removeprefix(f"{path}: ")[:90]
        return OUTCOMES[3 if reads else 4], f"{path.name}: {said}; ours: {why}"
    words = f"{path.name}: {said}, ours {len(mesh.faces)} faces"
    if other is None or not len(other):
        return OUTCOMES[2 if other is None else 1], words
    assert mesh.source is not None
    scale = mesh.source.scale_to_m
    if _same(nasty, mesh.corners, other * scale, scale):
        return OUTCOMES[0], words
    return OUTCOMES[1], words


def _same(
    nasty: ModuleType, ours: np.ndarray, theirs: np.ndarray, scale: float
) -> bool:
    if not np.all(np.isfinite(theirs)):
        return False
    if np.array_equal(nasty.places(ours, scale), nasty.places(theirs, scale)):
        return True
    (area, box), (other, other_box) = (_measures(c) for c in (ours, theirs))
    return bool(abs(area - other) <= 1e-5 * area and np.allclose(box, other_box))


def _measures(corners: np.ndarray) -> tuple[float, np.ndarray]:
    a, b, c = (corners[:, k] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    points = corners.reshape(-1, 3)
    return float(area), np.stack([points.min(axis=0), points.max(axis=0)])


if __name__ == "__main__":
    sys.exit(main())
