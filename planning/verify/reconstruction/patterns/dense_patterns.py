"""What a projector draws that codes every pixel: Gray code, white, black, sinusoids.

Every frame varies along one direction of the panel alone, so that it is told by the
light of a row of pixels, or of a column. Stripe g of a Gray code whose finest stripes
are m pixels wide is of pixels ``m g ... m (g + 1) - 1``; bit b of ``g ^ (g >> 1)`` is
bright in that bit's frame.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from planning.model.light.dense_code import DenseCode
from planning.verify.reconstruction.arrays import Array, Indices

from .response import Response
from .ring_patterns import Frame

Along = Literal["column", "row"]
ALONG: tuple[Along, Along] = ("column", "row")


@dataclass(frozen=True)
class DenseFrame(Frame):
    """One image of a dense sequence.

    Attributes:
        along: Which number of a pixel it tells, its column's or its row's; None of
            white and black.
        shift: Of a sinusoid, its k; None of the others.
    """

    along: Along | None = None
    shift: int | None = None

    @property
    def name(self) -> str:
        """Name of its files, without the ending."""
        what = {"bit": f"{self.along}-bit{self.bit}"}
        what["phase"] = f"{self.along}-shift{self.shift}"
        name = f"{self.number:02d}-{what.get(self.kind, self.kind)}"
        return f"{name}-inverse" if self.inverse else name


@dataclass(frozen=True)
class DensePattern:
    """The sequence of one panel.

    Attributes:
        code: Gray code and sinusoids.
        resolution: Width and height of the panel [px].
    """

    code: DenseCode
    resolution: tuple[int, int]

    @cached_property
    def frames(self) -> tuple[DenseFrame, ...]:
        """All frames, in the order in which they are shown."""
        return tuple(
            DenseFrame(n, kind, bit, None, inverse, along, shift)
            for n, (kind, bit, inverse, along, shift) in enumerate(self._sequence())
        )

    def _sequence(
        self,
    ) -> Iterator[
        tuple[
            Literal["bit", "white", "black", "phase"],
            int | None,
            bool,
            Along | None,
            int | None,
        ]
    ]:
        for axis, along in enumerate(ALONG):
            for bit in reversed(range(self.bits(axis))):
                yield "bit", bit, False, along, None
                yield "bit", bit, True, along, None
        yield "white", None, False, None, None
        yield "black", None, False, None, None
        for along in ALONG:
            for k in range(self.code.shifts):
                yield "phase", None, False, along, k

    def bits(self, axis: int) -> int:
        """Return how many bits tell columns (0) or rows (1)."""
        return self.code.bits(self.resolution[axis])

    def first_bit(self, axis: int) -> int:
        """Return the number of the frame of the highest bit of columns, or rows."""
        return 2 * self.bits(0) * axis

    @property
    def white(self) -> int:
        """Number of the white frame; black is the next one."""
        return 2 * (self.bits(0) + self.bits(1))

    def first_shift(self, axis: int) -> int:
        """Return the number of the first sinusoid of columns, or rows."""
        return self.white + 2 + axis * self.code.shifts

    def stripe(self, axis: int) -> Indices:
        """Return the stripe that each column or row lies in, shape (n,)."""
        return np.arange(self.resolution[axis]) // self.code.finest_px

    def shares(self, frame: DenseFrame) -> Array:
        """Return the light of columns or rows as a share of white's, shape (n,).

        Of white and black that of columns.
        """
        axis = ALONG.index(frame.along or "column")
        n = self.resolution[axis]
        if frame.kind == "bit":
            assert frame.bit is not None
            stripe = self.stripe(axis)
            lit = ((stripe ^ (stripe >> 1)) >> frame.bit) & 1
            return (1 - lit if frame.inverse else lit).astype(np.float64)
        if frame.kind == "phase":
            assert frame.shift is not None
            turns = np.arange(n) / self.code.period_px - frame.shift / self.code.shifts
            return 0.5 + 0.5 * np.cos(2.0 * np.pi * turns)
        return np.full(n, float(frame.kind == "white"))

    def levels(self, frame: DenseFrame, response: Response) -> NDArray[np.uint8]:
        """Return the grey levels of a frame, 0 to 255, shape (h, w)."""
        width, height = self.resolution
        line = response.levels(self.shares(frame))
        if frame.along == "row":
            line = line[:, None]
        return np.ascontiguousarray(np.broadcast_to(line, (height, width)))

    def entry(self) -> dict[str, Any]:
        """Return what decoders elsewhere must know of it, as plain JSON values."""
        return {
            "pattern": "dense",
            "bits": [self.bits(0), self.bits(1)],
            "finest_px": self.code.finest_px,
            "shifts": self.code.shifts,
            "period_px": self.code.period_px if self.code.shifts else None,
        }
