"""`cloud.ply`: the merged cloud, coloured by the uncertainty of each point.

Positions are in the unit and axes of the mesh file, so that both lie on each other in
any viewer; the header's comments say so and give the scale to metres.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from planning.model.document.input_records import MeshRecord
from planning.model.files import write_atomically
from planning.verify.reconstruction.check.merge import Merged

from .arrays import Array

_GENERATOR = "comment ringrig cloud"
_FIELDS = (
    *((name, "<f8") for name in ("x", "y", "z")),
    *((name, "<f4") for name in ("nx", "ny", "nz", "sigma")),
    *((name, "u1") for name in ("red", "green", "blue")),
)
_ROW = np.dtype(list(_FIELDS))
_PLY_TYPES = {"<f8": "double", "<f4": "float", "u1": "uchar"}

# Every seventeenth of the 256 colours of viridis (S. van der Walt, N. Smith, CC0);
# lightness rises evenly, so that colour blindness loses nothing.
_VIRIDIS = np.array(
    [
        [68, 1, 84],
        [72, 26, 108],
        [71, 47, 125],
        [65, 68, 135],
        [57, 86, 140],
        [49, 104, 142],
        [42, 120, 142],
        [35, 136, 142],
        [31, 152, 139],
        [34, 168, 132],
        [53, 183, 121],
        [84, 197, 104],
        [122, 209, 81],
        [165, 219, 54],
        [210, 226, 27],
        [253, 231, 37],
    ],
    dtype=np.float64,
)
_NAMES = ((0.0, "violet"), (0.5, "teal"), (1.0, "yellow"))
# Values beyond these quantiles take the colours of the ends.
_ENDS = (0.02, 0.98)


@dataclass(frozen=True)
class LengthUnit:
    """The unit that lengths of a file are in.

    Attributes:
        name: What it is called.
        in_m: How many metres it is.
    """

    name: str
    in_m: float

    @classmethod
    def of(cls, mesh: MeshRecord) -> "LengthUnit":
        """Return the unit of a plan's mesh; of a scaled one, a file unit."""
        unit = "file units" if mesh.unit == "size_mm" else mesh.unit
        return cls(unit, mesh.scale_to_m)


@dataclass(frozen=True, eq=False)
class CloudFile:
    """What `cloud.ply` holds.

    Attributes:
        rows: Points, normals, sigma and colours, one a row.
        unit: Of positions and sigma.
        limits: Sigma at both ends of the colour scale, in that unit.
    """

    rows: NDArray[np.void]
    unit: LengthUnit
    limits: tuple[float, float]

    @classmethod
    def of(cls, merged: Merged, unit: LengthUnit) -> "CloudFile":
        """Lay out a merged cloud.

        Where the normal isn't known it is 0 0 0, and sigma is the largest that any
        normal could give: the length of the point's move with its edge, times the
        edge's noise.
        """
        cloud = merged.cloud
        known = np.isfinite(merged.normals[:, 0])
        largest = np.linalg.norm(cloud.shift, axis=1) * cloud.noise_px
        sigma = np.where(known, merged.sigma, largest) / unit.in_m
        limits = _colour_range(sigma)
        rows = np.empty(len(cloud), dtype=_ROW)
        normals = np.where(known[:, None], merged.normals, 0.0)
        for axis, name in enumerate("xyz"):
            rows[name] = cloud.points[:, axis] / unit.in_m
            rows[f"n{name}"] = normals[:, axis]
        rows["sigma"] = sigma
        shades = _colours(sigma, limits)
        for channel, name in enumerate(("red", "green", "blue")):
            rows[name] = shades[:, channel]
        return cls(rows, unit, limits)

    @property
    def legend(self) -> str:
        """What the colours mean, in one line."""
        return _legend(self.limits, self.unit.name)

    def save(self, path: Path) -> None:
        """Write the file; its old content stays whole until the new one is complete.

        Raises:
            OSError: If it can't be written.
        """
        write_atomically(path, self._write)

    def _write(self, file: BinaryIO) -> None:
        low, high = self.limits
        header = [
            "ply",
            "format binary_little_endian 1.0",
            _GENERATOR,
            f"comment unit {self.unit.name}, {self.unit.in_m!r} m; axes of the mesh",
            "comment sigma: standard deviation along the normal, same unit",
            f"comment colour viridis by sigma, {low:.6g} to {high:.6g}: {self.legend}",
            f"element vertex {len(self.rows)}",
            *(f"property {_PLY_TYPES[kind]} {name}" for name, kind in _FIELDS),
            "end_header",
        ]
        file.write("".join(f"{line}\n" for line in header).encode("ascii"))
        file.write(self.rows.tobytes())


def remove_cloud(path: Path) -> bool:
    """Remove a cloud that was written here before, and nothing else; say if it was."""
    try:
        with path.open("rb") as file:
            ours = file.read(512).split(b"\n")[2:3] == [_GENERATOR.encode()]
    except OSError:
        return False
    if ours:
        path.unlink()
    return ours


def _colour_range(values: Array) -> tuple[float, float]:
    """Return what the ends of the scale stand for: the 2nd and 98th percentile."""
    low, high = np.quantile(values, _ENDS).tolist() if len(values) else (0.0, 1.0)
    return low, high


def _colours(values: Array, limits: tuple[float, float]) -> NDArray[np.uint8]:
    """Return the colour of each value, red, green and blue of 255, shape (n, 3)."""
    low, high = limits
    share = np.clip((values - low) / max(high - low, 1e-300), 0.0, 1.0)
    place = share * (len(_VIRIDIS) - 1)
    steps = np.arange(len(_VIRIDIS))
    mixed = [np.interp(place, steps, channel) for channel in _VIRIDIS.T]
    return np.rint(np.column_stack(mixed)).astype(np.uint8)


def _legend(limits: tuple[float, float], unit: str) -> str:
    """Return what the colours mean, in one line."""
    low, high = limits
    return ", ".join(
        f"{name} {low + share * (high - low):.4g} {unit}" for share, name in _NAMES
    )
