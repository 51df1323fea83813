"""`proof.npz`: why fewer devices are too few, for whoever asks.

Of each kind of device the frozen samples, and a certificate over the candidates, which
are the reference poses of `surface.npz`; and one over all poses.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array, Ints
from geometry.files.file_content import file_content

from .errors import PlanFileError
from .files import reading
from .packed_arrays import unpacked_arrays

KINDS = ("projector", "camera")
_Fields = dict[str, tuple[str, int]]
_OF_COVERS: _Fields = {
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
_OF_POSES: _Fields = {
    "draws": ("i", 2),
    "faces": ("i", 1),
    "n_devices": ("i", 0),
    "multipliers": ("i", 1),
}


# They take eight times their size when they are checked, and what they pay as much for
# each candidate; each node takes a look at all candidates. We write half as many.
_MOST_NUMBERS, _MOST_MULTIPLIERS, _MOST_NODES = 1 << 27, 1 << 12, 400_000


def sizes_of(draws: Ints) -> Ints:
    """Return how many samples each draw gives, of which every so many-th is taken."""
    return -(-draws[:, 0] // np.maximum(draws[:, 2], 1))


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
            and len(self.multipliers) <= min(len(self.nodes), _MOST_MULTIPLIERS)
            and len(self.nodes) <= _MOST_NODES
            and self.multipliers.size <= _MOST_NUMBERS
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
class PoseProof:
    """That no `n_devices` at any poses cover as many of the samples as are required.

    Attributes:
        draws: Of the samples, as of `CoverProof`.
        faces: Face of each sample, shape (n,).
        n_devices: More of them, beside existing ones, are too few.
        multipliers: Of the first samples, those that the bound speaks of, shape (k,).
    """

    # Samples come in the order of faces, so a part of a draw is of a part of the
    # surface: most must be of draws of which all are taken.
    _least_whole: ClassVar[float] = 0.8

    draws: Ints
    faces: Ints
    n_devices: int
    multipliers: Ints

    def __post_init__(self) -> None:
        whole = (
            self.draws.shape[1:] == (3,)
            and len(self.multipliers) <= len(self.faces)
            and bool(np.all(self.multipliers >= 0))
            # So that no sum of them overflows.
            and sum(self.multipliers.tolist()) < 1 << 62
            and self.n_devices >= 0
        )
        if not whole:
            raise PlanFileError("its arrays don't fit each other")

    @property
    def n_whole(self) -> int:
        """How many of the samples are of draws of which all are taken."""
        ends = np.cumsum(sizes_of(self.draws))
        return int(ends[ends <= len(self.multipliers)].max(initial=0))

    @property
    def is_of_whole_draws(self) -> bool:
        """Whether enough of its samples are, and it has any."""
        n = len(self.multipliers)
        return n > 0 and self.n_whole >= self._least_whole * n


@dataclass(frozen=True, eq=False)
class ProofFile:
    """What `proof.npz` holds, packed."""

    content: bytes

    @cached_property
    def sha256(self) -> str:
        """Its digest, hexadecimal."""
        return hashlib.sha256(self.content).hexdigest()

    @classmethod
    def of(
        cls,
        proofs: Mapping[str, CoverProof],
        over_poses: Mapping[str, PoseProof] | None = None,
    ) -> "ProofFile":
        """Pack the proofs of `projector` and `camera`, the same bytes for the same."""
        buffer = BytesIO()
        arrays: dict[str, Any] = {
            f"{kind}_{name}": getattr(proof, name)
            for kind, proof in proofs.items()
            for name in _OF_COVERS
        }
        arrays |= {
            f"{kind}_poses_{name}": getattr(proof, name)
            for kind, proof in (over_poses or {}).items()
            for name in _OF_POSES
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
            _ = proof.proofs, proof.over_poses
        except PlanFileError as error:
            raise PlanFileError(f"{path}: {error}; plan again") from None
        return proof

    @cached_property
    def proofs(self) -> dict[str, CoverProof]:
        """The proof over the candidates of each kind that has one.

        Raises:
            PlanFileError: If something is missing, or of another kind.
        """
        kinds = [kind for kind in KINDS if f"{kind}_nodes" in self._arrays]
        return {k: CoverProof(**_unpacked(k, _OF_COVERS, self._arrays)) for k in kinds}

    @cached_property
    def over_poses(self) -> dict[str, PoseProof]:
        """The same over all poses."""
        kinds = [k for k in KINDS if f"{k}_poses_multipliers" in self._arrays]
        return {
            k: PoseProof(**_unpacked(f"{k}_poses", _OF_POSES, self._arrays))
            for k in kinds
        }

    @cached_property
    def _arrays(self) -> dict[str, NDArray[Any]]:
        return unpacked_arrays(self.content)


def _unpacked(
    of: str, fields: _Fields, found: Mapping[str, NDArray[Any]]
) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for name, (numbers, ndim) in fields.items():
        array = found.get(f"{of}_{name}")
        if array is None or array.dtype.kind != numbers or array.ndim != ndim:
            raise PlanFileError(f"`{of}_{name}` is missing, or of another kind")
        # Sums of narrower numbers would wrap; of multipliers in 240ths all fit a byte.
        width = {"i": np.int64, "f": np.float64, "u": np.uint8}[numbers]
        if not np.can_cast(array.dtype, width):
            raise PlanFileError(f"`{of}_{name}` holds {array.dtype}, not {width}")
        values[name] = int(array) if ndim == 0 else array.astype(width)
    return values
