"""What a joint cover asks: projectors that light, and cameras that measure with them.

Sample e is lit if a chosen projector p lights it (a_ep = 1), and measured if a chosen
projector and a chosen camera c measure it together (b_ecp = 1)::

    minimise    sum_p f_p x_p  +  sum_c g_c z_c
    subject to  |{e : a_ep x_p = 1 for some p}|           >= W_l
                |{e : b_ecp x_p z_c = 1 for some p, c}|   >= W_m
                x, z in {0, 1}

and likewise for the samples of each row set, with floors of its own. With the
projectors fixed, what is left is a cover by cameras, and with the cameras fixed one by
projectors; a camera's sets grow with every projector that is taken.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from solvers.bit_rows import pack_rows, sparse_rows, unpack_rows
from solvers.checked_numbers import real_numbers, set_names, whole_numbers
from solvers.covers.cover_problem import CoverProblem

# One byte each.
MAX_PAIR_ENTRIES = 1_000_000_000
_Mask = NDArray[np.bool_]
_Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Requirement:
    """How many samples must be covered: in all, and of each row set.

    Attributes:
        total: Of all samples.
        floors: Of each row set, 0 for none, shape (n_g,); default none.
    """

    total: int
    floors: _Index = field(default=())  # type: ignore[assignment]

    def __post_init__(self) -> None:
        floors = whole_numbers("floors", self.floors)
        if floors.ndim != 1 or not np.all(floors >= 0) or not self.total >= 0:
            raise ValueError(
                f"a requirement is a number and a row of floors, at least 0; got "
                f"{self.total} and {floors.tolist()}"
            )
        floors.flags.writeable = False
        object.__setattr__(self, "floors", floors)

    def met(self, covered: _Mask, row_sets: _Index) -> bool:
        """Return whether covered samples, a mask of shape (n_e,), are enough."""
        counts = np.bincount(row_sets[covered], minlength=len(self.floors))
        floors = np.all(counts[: len(self.floors)] >= self.floors)
        return int(covered.sum()) >= self.total and bool(floors)


@dataclass(frozen=True, eq=False)
class JointProblem:
    """Data of a joint cover.

    Attributes:
        lit: Whether projector p lights sample e, shape (n_e, n_p).
        pairs: Whether camera c measures sample e with projector p, which lights it,
            shape (n_e, n_c, n_p).
        required_lit: What must be lit.
        required_measured: What must be measured.
        row_sets: Row set of each sample, 0, 1 and so on, shape (n_e,); default 0.
        projector_costs: Positive, shape (n_p,); default 1.
        camera_costs: Positive, shape (n_c,); default 1.
        most: Projectors and cameras that are allowed; None for any number.

    Raises:
        ValueError: On wrong shapes, pairs of which the projector lights nothing, costs
            that aren't positive and finite, requirements of more samples than there
            are, or more than ``MAX_PAIR_ENTRIES`` pairs.
    """

    lit: _Mask
    pairs: _Mask
    required_lit: Requirement
    required_measured: Requirement
    row_sets: _Index = field(default=None)  # type: ignore[assignment]
    projector_costs: NDArray[np.float64] = field(default=None)  # type: ignore[assignment]
    camera_costs: NDArray[np.float64] = field(default=None)  # type: ignore[assignment]
    most: tuple[int | None, int | None] = (None, None)

    def __post_init__(self) -> None:
        lit, pairs = np.asarray(self.lit), np.asarray(self.pairs)
        if lit.dtype != np.bool_ or pairs.dtype != np.bool_:
            raise ValueError(f"lit and pairs are masks, got {lit.dtype}, {pairs.dtype}")
        n_e, n_p = lit.shape if lit.ndim == 2 else (-1, -1)
        if pairs.ndim != 3 or (pairs.shape[0], pairs.shape[2]) != (n_e, n_p):
            raise ValueError(
                f"lit must be (n_e, n_p) and pairs (n_e, n_c, n_p), got {lit.shape} "
                f"and {pairs.shape}"
            )
        if pairs.size > MAX_PAIR_ENTRIES:
            raise ValueError(f"{pairs.size} pairs, at most {MAX_PAIR_ENTRIES} fit")
        if np.any(pairs & ~lit[:, None]):
            raise ValueError(
                "a pair measures a sample that its projector doesn't light"
            )
        row_sets = np.zeros(n_e, dtype=np.int64)
        if self.row_sets is not None:  # pyright: ignore[reportUnnecessaryComparison]
            row_sets = whole_numbers("row_sets", self.row_sets)
        if row_sets.shape != (n_e,) or not np.all(row_sets >= 0):
            raise ValueError(f"row_sets must be ({n_e},), at least 0")
        if not all(most is None or most >= 1 for most in self.most):
            raise ValueError(f"at least one of each kind is allowed, got {self.most}")
        for required in (self.required_lit, self.required_measured):
            _check_there(required, row_sets)
        values = {
            "row_sets": row_sets,
            "projector_costs": _costs("projector_costs", self.projector_costs, n_p),
            "camera_costs": _costs("camera_costs", self.camera_costs, pairs.shape[1]),
        }
        for name, value in values.items():
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    @property
    def n_projectors(self) -> int:
        """Number of projectors on offer."""
        return self.lit.shape[1]

    @property
    def n_cameras(self) -> int:
        """Number of cameras on offer."""
        return self.pairs.shape[1]

    def lit_by(self, projectors: ArrayLike) -> _Mask:
        """Return which samples projectors light, shape (n_e,)."""
        chosen = set_names("projectors", projectors, self.n_projectors)
        return np.any(self.lit[:, chosen], axis=1)

    def measured_by(self, projectors: ArrayLike, cameras: ArrayLike) -> _Mask:
        """Return which samples pairs of chosen devices measure, shape (n_e,)."""
        p = set_names("projectors", projectors, self.n_projectors)
        c = set_names("cameras", cameras, self.n_cameras)
        bits = self._bits[np.ix_(p, c)]
        return self.measured_by_rows(bits.reshape(p.size * c.size, bits.shape[2]))

    def measured_by_rows(self, rows: NDArray[np.uint64]) -> _Mask:
        """Return which samples any of some bit rows holds, shape (n_e,)."""
        bits = np.bitwise_or.reduce(rows, axis=0)
        return unpack_rows(bits[None], len(self.lit))[0]

    def enough(self, projectors: ArrayLike, cameras: ArrayLike) -> bool:
        """Return whether devices light and measure enough, and are no more than may."""
        p, c = (np.asarray(some, dtype=np.int64) for some in (projectors, cameras))
        counts = zip((p.size, c.size), self.most, strict=True)
        return (
            all(most is None or n <= most for n, most in counts)
            and self.required_lit.met(self.lit_by(p), self.row_sets)
            and self.required_measured.met(self.measured_by(p, c), self.row_sets)
        )

    def cost(self, projectors: ArrayLike, cameras: ArrayLike) -> float:
        """Return what devices cost."""
        p = set_names("projectors", projectors, self.n_projectors)
        c = set_names("cameras", cameras, self.n_cameras)
        return float(self.projector_costs[p].sum() + self.camera_costs[c].sum())

    @cached_property
    def _bits(self) -> NDArray[np.uint64]:
        """Bit rows of what each pair measures, (n_p, n_c, n_words)."""
        n_e, n_c, n_p = self.pairs.shape
        rows = np.ascontiguousarray(self.pairs.T).reshape(n_p * n_c, n_e)
        return pack_rows(rows).reshape(n_p, n_c, -1)

    def rows_with(self, projectors: ArrayLike) -> NDArray[np.uint64]:
        """Return bit rows of what each camera measures with any of them, (n_c, w)."""
        chosen = set_names("projectors", projectors, self.n_projectors)
        return np.bitwise_or.reduce(self._bits[chosen], axis=0)

    def measured_with(self, projectors: ArrayLike) -> _Mask:
        """Return which camera measures which sample with any of them, (n_e, n_c)."""
        return unpack_rows(self.rows_with(projectors), len(self.lit)).T

    def camera_cover(self, projectors: ArrayLike) -> CoverProblem:
        """State the cover by cameras that is left with these projectors."""
        covers = self.measured_with(projectors)
        required = self.required_measured
        if not required.floors.any():
            total = np.array([float(required.total)])
            return CoverProblem(
                sparse_rows(covers), costs=self.camera_costs, required_weight=total
            )
        floors = np.zeros(1 + self.row_sets.max(initial=0))
        # The last row sets may have no sample, and then no floor.
        some = required.floors[: len(floors)]
        floors[: len(some)] = some
        return CoverProblem(
            sparse_rows(covers),
            costs=self.camera_costs,
            required_weight=floors,
            required_total=float(required.total),
            row_sets=self.row_sets,
        )

    def projector_cover(
        self, cameras: ArrayLike | None, hits: Sequence[_Mask] = ()
    ) -> CoverProblem:
        """State the cover by projectors that is left with these cameras.

        Without cameras, of what must be lit alone. Of each mask of `hits`, shape
        (n_p,), a projector must be taken.
        """
        parts = [self._groups(self.lit, self.required_lit)]
        if cameras is not None:
            chosen = set_names("cameras", cameras, self.n_cameras)
            measured = np.any(self.pairs[:, chosen], axis=1)
            parts.append(self._groups(measured, self.required_measured))
        parts.append([(hit[None], 1) for hit in hits])
        groups = [(rows, n) for part in parts for rows, n in part if n > 0]
        if not groups:
            groups = [(self.lit, 0)]
        sizes = [len(rows) for rows, _ in groups]
        return CoverProblem(
            sparse_rows(np.concatenate([rows for rows, _ in groups])),
            costs=self.projector_costs,
            required_weight=np.array([float(n) for _, n in groups]),
            row_sets=np.repeat(np.arange(len(groups)), sizes),
        )

    def _groups(self, covers: _Mask, required: Requirement) -> list[tuple[_Mask, int]]:
        """Return groups of rows with what each asks; floors repeat their rows."""
        groups = [(covers, required.total)]
        for g, floor in enumerate(required.floors.tolist()):
            groups.append((covers[self.row_sets == g], floor))
        return groups


def _check_there(required: Requirement, row_sets: _Index) -> None:
    n_g = len(required.floors)
    there = np.bincount(row_sets, minlength=n_g)[:n_g]
    if not required.total <= len(row_sets) or not np.all(required.floors <= there):
        raise ValueError(
            f"{required.total} samples and {required.floors.tolist()} of row sets are "
            f"required, there are {len(row_sets)} and {there.tolist()}"
        )


def _costs(name: str, values: ArrayLike | None, n: int) -> NDArray[np.float64]:
    costs = np.ones(n) if values is None else real_numbers(name, values)
    if costs.shape != (n,):
        raise ValueError(f"{name} must be ({n},), got {costs.shape}")
    if not np.all((costs > 0.0) & np.isfinite(costs)):
        raise ValueError(f"{name} must be positive and finite")
    return costs
