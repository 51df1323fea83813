"""What may have changed: pose or optics of one device, two swapped, the object.

How well a change explains the edges is told by the mismatch that it leaves: a mean over
the pairs of devices of the mean over each pair's sound edges, without outliers, and
whichever pair has most edges.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from planning.verify.reconstruction.arrays import Array, Indices

from .bundle import SHIFT, TURN, ZOOM, Bundle
from .supposed import Evidence, Role, Supposed, mismatches, places

Move = Literal["turn", "shift", "zoom", "swap"]
Moves = tuple[Move, ...]
_PARTS = {"turn": TURN, "shift": SHIFT, "zoom": ZOOM}
_OF_DEVICE: tuple[Moves, ...] = ("zoom",), ("turn",), ("shift",), ("turn", "shift")
_OF_OBJECT: tuple[Moves, ...] = (
    ("zoom",),
    ("shift",),
    ("turn", "shift"),
    ("turn", "shift", "zoom"),
)
# What may change of each.
ROLES: dict[Role, tuple[Moves, ...]] = {
    "cameras": _OF_DEVICE,
    "projectors": _OF_DEVICE,
    "objects": _OF_OBJECT,
}
# A pair's mismatch is the mean of this share of its edges, the rest are outliers.
_SOUND_SHARE = 0.85
# No mismatch counts for more, and an edge that misses the object for as much [m].
_CAP_M = 5e-3


@dataclass(frozen=True)
class Change:
    """What may be changed, and by which moves; of two devices only `swap`."""

    role: Role
    devices: tuple[int, ...]
    moves: Moves

    @property
    def size(self) -> int:
        """Free parameters; what can't be told from edges counts, too."""
        return sum({"swap": 0, "zoom": 1}.get(move, 3) for move in self.moves)

    def columns(self, bundle: Bundle) -> Indices:
        """Return the unknowns that it frees."""
        parts = [_PARTS[move] for move in self.moves]
        of = self.role, self.devices[0]
        return np.concatenate([bundle.columns(*of, part) for part in parts])

    def repeats(self, other: "Change") -> bool:
        """Return whether it is the other one again, or with more freedom."""
        same = self.role == other.role and self.devices == other.devices
        return same and {*self.moves} >= {*other.moves}


@dataclass(frozen=True, eq=False)
class Explanation:
    """A change, how everything is supposed to stand before and after it.

    `left_m` is the mismatch [m] before and after, of all edges.
    """

    change: Change
    before: Supposed
    after: Supposed
    left_m: tuple[float, float]


# Equally good explanations of one thing that is wrong, the simplest first.
Cause = tuple[Explanation, ...]


def misfit(evidence: Evidence, rig: Supposed, cap_m: float = _CAP_M) -> float:
    """Return the mismatch of edges [m], mean over the pairs."""
    off = np.abs(mismatches(evidence, rig, places(evidence, rig))[1])
    off = np.minimum(np.where(np.isfinite(off), off, cap_m), cap_m)
    pairs = evidence.projector * len(rig.cameras) + evidence.camera
    return float(np.mean([_sound(off[pairs == pair]) for pair in np.unique(pairs)]))


def _sound(size: Array) -> float:
    """Return the mean of the smaller ones."""
    return float(np.sort(size)[: int(np.ceil(_SOUND_SHARE * len(size)))].mean())
