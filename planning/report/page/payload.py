"""Arrays as text in a page: quantised, filtered, deflated, in base64.

The browser undoes each step (`viewer/payload.js`): its own `DecompressionStream`
inflates, so that nothing need be fetched and no decoder be carried.
"""

import base64
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.arrays import Array

# Codes of `quantised`: the largest says that there is no value.
NOTHING = 255
_STEPS = 254
# Positions, in steps of the bounding box.
_PLACES = 65535
# Higher levels take twice the time for a hundredth of the size.
_LEVEL = 6


@dataclass(eq=False)
class Payload:
    """Arrays to be unpacked in a browser, in the order in which they were added.

    Attributes:
        entries: Name, kind of number, count and filter of each.
        planes: Their bytes after the filter.
    """

    entries: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    planes: list[bytes] = field(default_factory=list[bytes])

    def add(self, name: str, values: NDArray[Any], *, delta: bool = False) -> None:
        """Add unsigned integers, column by column where there are several.

        Args:
            name: What the viewer asks for.
            values: Of one, two or four bytes each, (n,) or (n, columns).
            delta: Whether each is stored as its step from the one before, zigzag, byte
                planes apart: what is smooth deflates to a fraction.
        """
        columns = values[:, None] if values.ndim == 1 else values
        size = columns.dtype.itemsize
        entry = {"name": name, "bytes": size, "n": len(columns)}
        entry |= {"columns": columns.shape[1], "delta": delta}
        self.entries.append(entry)
        for column in columns.T:
            whole = column.astype(np.int64)
            if delta:
                step = np.diff(whole, prepend=0)
                whole = np.where(step < 0, -2 * step - 1, 2 * step)
            # Steps of the largest numbers take one bit more than their values do.
            width = size + 1 if delta else size
            raw = whole.astype("<u8").view(np.uint8).reshape(-1, 8)
            self.planes.append(np.ascontiguousarray(raw[:, :width].T).tobytes())

    def text(self) -> str:
        """Return all arrays as base64 of one deflate stream without a header."""
        packer = zlib.compressobj(_LEVEL, zlib.DEFLATED, -15)
        content = packer.compress(b"".join(self.planes)) + packer.flush()
        return base64.b64encode(content).decode("ascii")


def add_mesh(
    payload: Payload, name: str, vertices: Array, faces: NDArray[np.int64]
) -> dict[str, Any]:
    """Add a mesh, positions as 16-bit steps of its bounding box; return that box [m].

    Corners of a face are written as steps from its first, and that from the face
    before.
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    side = np.where(high > low, high - low, 1.0)
    places = np.rint((vertices - low) / side * _PLACES).astype(np.uint16)
    payload.add(f"{name}.places", places, delta=True)
    first = faces[:, :1]
    turned = np.concatenate([first, _zigzag(faces[:, 1:] - first)], axis=1)
    payload.add(f"{name}.first", turned[:, 0].astype(np.uint32), delta=True)
    payload.add(f"{name}.others", turned[:, 1:].astype(np.uint32))
    return {"low": low.tolist(), "side": side.tolist()}


def quantised(values: Array, low: float, high: float) -> NDArray[np.uint8]:
    """Return values as 0 to 254 of the way from `low` to `high`; NaN as `NOTHING`."""
    shares = (np.nan_to_num(values, nan=low) - low) / max(high - low, 1e-300)
    codes = np.rint(np.clip(shares, 0.0, 1.0) * _STEPS)
    return np.where(np.isnan(values), NOTHING, codes).astype(np.uint8)


def _zigzag(steps: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.where(steps < 0, -2 * steps - 1, 2 * steps)
