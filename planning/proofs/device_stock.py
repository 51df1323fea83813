"""How many devices of each model there are, as covers count them."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.scene.placed_bodies import Device


@dataclass(frozen=True, eq=False)
class DeviceStock:
    """Models of candidates, and how many of each a selection may hold.

    Attributes:
        kinds: Model of each candidate, by number, shape (m,).
        counts: How many there are of each, shape (n_k,).
    """

    kinds: NDArray[np.int64]
    counts: NDArray[np.int64]

    @classmethod
    def of(
        cls, candidates: Sequence[Device], counts: Mapping[str, int]
    ) -> "DeviceStock | None":
        """Return the stock of candidates by their models' names; None: no count."""
        if not counts:
            return None
        models = sorted({candidate.model for candidate in candidates})
        place = {model: k for k, model in enumerate(models)}
        kinds = np.array([place[one.model] for one in candidates], dtype=np.int64)
        many = len(candidates)
        return cls(kinds, np.array([counts.get(m, many) for m in models], np.int64))

    def left(self, taken: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return what candidates leave of each model, shape (n_k,)."""
        return self.counts - np.bincount(self.kinds[taken], minlength=self.counts.size)

    @property
    def total(self) -> int:
        """How many devices there are of all models together."""
        return int(self.counts.sum())


def within_stock(devices: Iterable[Device], counts: Mapping[str, int]) -> bool:
    """Return whether there are as many devices of each model as are taken."""
    taken = Counter(device.model for device in devices)
    return all(taken[model] <= count for model, count in counts.items())
