"""What a plan was made with: where it is the same, so is every figure."""

from functools import cache
from platform import machine, python_version
from typing import Self

import numpy as np

from planning.model.installed import sources_hash, versions

from .part import Part


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
def _here() -> tuple[str, dict[str, str], str]:
    config = np.show_config(mode="dicts") or {}
    found = config.get("SIMD Extensions", {}).get("found", [])
    libraries = {"python": python_version(), **versions()}
    return sources_hash(), libraries, " ".join((machine(), *found))
