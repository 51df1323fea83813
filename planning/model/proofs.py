"""`proof.npz`: why fewer of the candidates are too few, for whoever asks.

Of each kind of device the frozen samples, and one certificate: the candidates are the
reference poses of `surface.npz`.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any, ClassVar
from zipfile import ZipFile

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array, Ints
from geometry.files.file_content import file_content

from .errors import PlanFileError
from .files import reading
from .surface import DAMAGED

# What all arrays of a kind may take, unpacked [bytes].
_LARGEST = 1_000_000_000
_FIELDS: dict[str, tuple[str, int]] = {
    "draws": ("i", 2),
    "points": ("f", 2),
    "faces": ("i", 1),
    "n_sets": ("i", 0),
    "stand_in": ("i", 1),
    "multipliers": ("u", 2),
    "nodes": ("i", 1),
    "groups": ("i", 1),
    "group_ends": ("i", 1),
}


# They take eight times their size when they are checked.
_MOST_MULTIPLIERS = 1 << 27


@dataclass(frozen=True, eq=False)
class CoverProof:
    """That no `n_sets` candidates cover as many of the samples as are required.

    Attributes:
        draws: Of the samples, one draw after the other: how many, by which stream, and
            that every so many-th was taken, shape (k, 3).
        points: Where the samples lie [m], shape (n, 3).
        faces: Face of each, shape (n,).
        n_sets: Candidates that are too few.
        stand_in: For each candidate the one that stands for it, shape (m,).
        multipliers: Of each sample, in parts of `whole`, shape (k, n).
        nodes: Of the tree, `docs/method/covers.md`.
        groups: Candidates of all branches, one after the other.
        group_ends: Where those of each branch end.
    """

    BRANCH: ClassVar[int] = -1
    whole: ClassVar[int] = 240

    draws: Ints
    points: Array
    faces: Ints
    n_sets: int
    stand_in: Ints
    multipliers: NDArray[np.uint8]
    nodes: Ints
    groups: Ints
    group_ends: Ints

    def __post_init__(self) -> None:
        n, m = len(self.faces), len(self.stand_in)
        ends = self.group_ends
        whole = (
            self.points.shape == (n, 3)
            and self.draws.shape[1:] == (3,)
            and self.multipliers.shape[1:] == (n,)
            # A leaf names one; so many more are no file of ours.
            and len(self.multipliers) <= len(self.nodes)
            and self.multipliers.size <= _MOST_MULTIPLIERS
            and bool(np.all(np.isfinite(self.points)))
            and bool(np.all((self.stand_in >= 0) & (self.stand_in < m)))
            and bool(np.all((self.groups >= 0) & (self.groups < m)))
            and bool(np.all(np.diff(ends, prepend=0) > 0))
            and len(self.groups) == (ends[-1] if len(ends) else 0)
            and self.n_sets >= 0
        )
        if not whole:
            raise PlanFileError("its arrays don't fit each other")


@dataclass(frozen=True, eq=False)
class ProofFile:
    """What `proof.npz` holds, packed."""

    content: bytes

    @cached_property
    def sha256(self) -> str:
        """Its digest, hexadecimal."""
        return hashlib.sha256(self.content).hexdigest()

    @classmethod
    def of(cls, proofs: Mapping[str, CoverProof]) -> "ProofFile":
        """Pack the proofs of `projector` and `camera`, the same bytes for the same."""
        buffer = BytesIO()
        arrays: dict[str, Any] = {
            f"{kind}_{name}": getattr(proof, name)
            for kind, proof in proofs.items()
            for name in _FIELDS
        }
        np.savez_compressed(buffer, **arrays)
        return cls(buffer.getvalue())

    @classmethod
    def load(cls, path: Path, sha256: str) -> "ProofFile | None":
        """Read the file of a plan that states its digest; None where there is none.

        Raises:
            PlanFileError: If it is another one than the plan's, or broken.
        """
        if not path.exists():
            return None
        with reading(path, PlanFileError):
            proof = cls(file_content(path))
        if proof.sha256 != sha256:
            raise PlanFileError(
                f"{path}: its SHA-256 isn't the one in the plan; the two files must "
                f"come from one run"
            )
        try:
            _ = proof.proofs
        except PlanFileError as error:
            raise PlanFileError(f"{path}: {error}; plan again") from None
        return proof

    @cached_property
    def proofs(self) -> dict[str, CoverProof]:
        """The proof of each kind that has one.

        Raises:
            PlanFileError: If something is missing, or of another kind.
        """
        try:
            with ZipFile(BytesIO(self.content)) as archive:
                size = sum(entry.file_size for entry in archive.infolist())
            if size > _LARGEST:
                raise PlanFileError(f"it holds {size} bytes, at most {_LARGEST}")
            with np.load(BytesIO(self.content), allow_pickle=False) as archive:
                found = {name: archive[name] for name in archive.files}
        except PlanFileError:
            raise
        except (OSError, ValueError, *DAMAGED) as error:
            raise PlanFileError(f"not a readable .npz ({error})") from None
        kinds = [k for k in ("projector", "camera") if f"{k}_nodes" in found]
        return {kind: _unpacked(kind, found) for kind in kinds}


def _unpacked(kind: str, found: Mapping[str, NDArray[Any]]) -> CoverProof:
    fields: dict[str, Any] = {}
    for name, (numbers, ndim) in _FIELDS.items():
        array = found.get(f"{kind}_{name}")
        if array is None or array.dtype.kind != numbers or array.ndim != ndim:
            raise PlanFileError(f"`{kind}_{name}` is missing, or of another kind")
        fields[name] = int(array) if ndim == 0 else array
    return CoverProof(**fields)
