"""What a plan was made with: where it is the same, so is every figure."""

import hashlib
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from platform import machine, python_version
from typing import Self

import numpy as np

from .part import Part

_PACKAGES = "geometry", "planning", "solvers"
# Those whose numbers end up in the plan or its check.
_LIBRARIES = (
    *("numpy", "scipy", "embreex", "libigl", "casadi", "cvxpy", "highspy"),
    *("trimesh", "Pillow"),
)


class MadeWith(Part):
    """Code, libraries and arithmetic that made a plan.

    Attributes:
        code: SHA-256 of ringrig's own sources.
        libraries: Version of each, `python` and `ringrig` among them.
        arithmetic: Processor, and the vector instructions that numpy finds: sums are
            split by them.
    """

    code: str
    libraries: dict[str, str]
    arithmetic: str

    @classmethod
    def here(cls) -> Self:
        """Return what runs now."""
        code, libraries, arithmetic = _here()
        return cls(code=code, libraries=dict(libraries), arithmetic=arithmetic)

    def differs(self, other: "MadeWith") -> str:
        """Return what of another is different, in a few words; "" where nothing is."""
        for name in {**self.libraries, **other.libraries}:
            ours, theirs = (m.libraries.get(name, "none") for m in (self, other))
            if ours != theirs:
                return f"{name} {ours}, here {theirs}"
        if self.code != other.code:
            return "another state of ringrig"
        if self.arithmetic != other.arithmetic:
            return "another processor"
        return ""


@cache
def _here() -> tuple[str, tuple[tuple[str, str], ...], str]:
    root = Path(__file__).parents[3]
    hashed = hashlib.sha256()
    for package in _PACKAGES:
        for path in sorted((root / package).rglob("*.py")):
            hashed.update(f"{path.relative_to(root).as_posix()}\n".encode())
            hashed.update(path.read_bytes())
    names = ("ringrig", *_LIBRARIES)
    libraries = ("python", python_version()), *((n, _version(n)) for n in names)
    config = np.show_config(mode="dicts") or {}
    found = config.get("SIMD Extensions", {}).get("found", [])
    return hashed.hexdigest(), libraries, " ".join((machine(), *found))


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"
