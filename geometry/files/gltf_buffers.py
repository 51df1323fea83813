"""Numbers that a glTF file's accessors name, every offset held to what is there."""

import base64
import binascii
from collections.abc import Callable, Mapping, Sequence
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from .reading import FormatError

Fetch = Callable[[str], bytes]
Tree = Mapping[str, Any]
_COMPONENTS = {
    **{5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2"},
    **{5125: "<u4", 5126: "<f4"},
}
_INDICES = (5121, 5123, 5125)
_FLOAT = 5126
_WIDTH = {"SCALAR": 1, "VEC3": 3}
QUANTIZED = "KHR_mesh_quantization"
PACKED = (
    "KHR_draco_mesh_compression",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
)


def item(tree: Tree, kind: str, index: object) -> Any:  # noqa: ANN401
    """Return an entry of a list of the file by its number."""
    held = tree.get(kind, ())
    if type(index) is not int or not 0 <= index < len(held):
        raise FormatError(f"it names entry {index} of {len(held)} {kind}")
    return held[index]


class Buffers:
    """The buffers of a file, each read once."""

    def __init__(self, tree: Tree, fetch: Fetch | None, stored: bytes | None) -> None:
        self._tree = tree
        self._fetch = fetch
        self._stored = stored
        self._read: dict[int, bytes] = {}

    def values(self, index: object, kind: str) -> NDArray[np.generic]:
        """Return the rows of an accessor, (count, 1) or (count, 3)."""
        accessor = item(self._tree, "accessors", index)
        if "sparse" in accessor:
            raise FormatError("it stores sparse accessors, which aren't read")
        if "bufferView" not in accessor:
            raise FormatError(
                "an accessor stores no data: its compression isn't supported"
            )
        component = accessor.get("componentType")
        if accessor.get("type") != kind or component not in self._allowed(kind):
            raise FormatError(
                f"accessor {index} holds {accessor.get('type')} of {component}, "
                f"where {kind} is needed"
            )
        view = item(self._tree, "bufferViews", accessor["bufferView"])
        if set(PACKED) & set(view.get("extensions", ())):
            raise FormatError("its buffers are compressed; export it uncompressed")
        dtype = np.dtype(_COMPONENTS[component])
        values = self._strided(accessor, view, dtype, _WIDTH[kind])
        if accessor.get("normalized") and component != _FLOAT:
            return np.maximum(values.astype(np.float64) / np.iinfo(dtype).max, -1.0)
        return values

    def _allowed(self, kind: str) -> Sequence[int]:
        if kind == "SCALAR":
            return _INDICES
        quantized = QUANTIZED in self._tree.get("extensionsUsed", ())
        return tuple(c for c in _COMPONENTS if c != 5125) if quantized else (_FLOAT,)

    def _strided(
        self, accessor: Tree, view: Tree, dtype: np.dtype, columns: int
    ) -> NDArray[np.generic]:
        """Return the rows, shape (count, columns), each a stride after the last."""
        data = self._buffer(view.get("buffer"))
        width = dtype.itemsize * columns
        count = natural(accessor, "count")
        stride = natural(view, "byteStride", width)
        begin, size = natural(view, "byteOffset", 0), natural(view, "byteLength")
        offset = natural(accessor, "byteOffset", 0)
        if begin + size > len(data):
            raise FormatError(
                f"it names {begin + size} bytes of a {len(data)} byte buffer"
            )
        if count == 0:
            return np.empty((0, columns), dtype)
        if stride < width or offset + (count - 1) * stride + width > size:
            raise FormatError(f"{count} rows don't fit into a view of {size} bytes")
        strides = (stride, dtype.itemsize)
        return np.ndarray((count, columns), dtype, data, begin + offset, strides)

    def _buffer(self, index: object) -> bytes:
        entry = item(self._tree, "buffers", index)
        assert isinstance(index, int)
        if index not in self._read:
            data = self._bytes(entry, index)
            if len(data) < natural(entry, "byteLength"):
                raise FormatError(
                    f"its buffer {index} is cut short: {len(data)} of "
                    f"{entry['byteLength']} bytes"
                )
            self._read[index] = data
        return self._read[index]

    def _bytes(self, entry: Tree, index: int) -> bytes:
        if "uri" not in entry:
            if index or self._stored is None:
                raise FormatError(f"its buffer {index} isn't there")
            return self._stored
        uri = str(entry["uri"])
        if uri.startswith("data:"):
            try:
                return base64.b64decode(uri.partition(",")[2], validate=True)
            except binascii.Error as error:
                raise FormatError(f"its buffer {index}: {error}") from None
        if self._fetch is None:
            raise FormatError(f"it needs the file '{uri[:60]}', which isn't beside it")
        return self._fetch(unquote(uri))


def natural(entry: Tree, key: str, default: int | None = None) -> int:
    """Return a number of an entry that must be whole and not negative."""
    value = entry.get(key, default)
    if type(value) is not int or value < 0:
        raise FormatError(f"its {key} is {value}, must be a whole number from 0 on")
    return value
