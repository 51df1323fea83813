"""What runs: ringrig's own sources by their hash, and versions of libraries."""

import hashlib
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_PACKAGES = "geometry", "planning", "solvers"
# Another version of these may round otherwise.
LIBRARIES = (
    *("numpy", "scipy", "libigl", "trimesh", "embreex", "casadi", "cvxpy", "highspy"),
    "Pillow",
)


def sources_hash(without: Iterable[str] = ()) -> str:
    """Return a SHA-256 of ringrig's sources, hexadecimal.

    Args:
        without: Rooms of the packages that are left out.
    """
    root, left_out = Path(__file__).parents[2], frozenset(without)
    hashed = hashlib.sha256()
    for package in _PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            name = path.relative_to(root)
            if name.parts[1] not in left_out:
                hashed.update(f"{name.as_posix()}\n".encode() + path.read_bytes())
    return hashed.hexdigest()


def versions() -> dict[str, str]:
    """Return the version of ringrig and of each library; "none" where it isn't."""
    return {name: _version(name) for name in ("ringrig", *LIBRARIES)}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"
