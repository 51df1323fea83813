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
_VIRIDIS = (
    "440154 481a6c 472f7d 414487 39568c 31688e 2a788e 23888e "
    "1f988b 22a884 35b779 54c568 7ad151 a5db36 d2e21b fde725"
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
        digest: Of the plan by which it was measured.
    """

    rows: NDArray[np.void]
    unit: LengthUnit
    limits: tuple[float, float]
    digest: str = ""

    @classmethod
    def of(cls, merged: Merged, unit: LengthUnit, digest: str = "") -> "CloudFile":
        """Lay out a merged cloud.

        Where the normal isn't known it is 0 0 0, and sigma is the largest that any
        normal could give: the length of the point's move with its edge, times the
        edge's noise.
        """
        cloud = merged.cloud
        known = np.isfinite(merged.normals[:, 0])
        largest = np.linalg.norm(cloud.shift, axis=1) * cloud.noise_px
        sigma = np.where(known, merged.sigma, largest) / unit.in_m
        low, high = np.quantile(sigma, _ENDS).tolist() if len(cloud) else (0.0, 1.0)
        rows = np.empty(len(cloud), dtype=_ROW)
        normals = np.where(known[:, None], merged.normals, 0.0)
        for axis, name in enumerate("xyz"):
            rows[name] = cloud.points[:, axis] / unit.in_m
            rows[f"n{name}"] = normals[:, axis]
        rows["sigma"] = sigma
        shades = np.rint(ramp(_VIRIDIS, (sigma - low) / max(high - low, 1e-300)))
        for channel, name in enumerate(("red", "green", "blue")):
            rows[name] = shades[:, channel]
        return cls(rows, unit, (low, high), digest)

    @property
    def legend(self) -> str:
        """What the colours mean, in one line."""
        low, high = self.limits
        return ", ".join(
            f"{name} {low + share * (high - low):.4g} {self.unit.name}"
            for share, name in _NAMES
        )

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
            *([f"comment plan {self.digest}"] if self.digest else []),
            "comment sigma: standard deviation along the normal, same unit",
            f"comment colour viridis by sigma, {low:.6g} to {high:.6g}: {self.legend}",
            f"element vertex {len(self.rows)}",
            *(f"property {_PLY_TYPES[kind]} {name}" for name, kind in _FIELDS),
            "end_header",
        ]
        file.write("".join(f"{line}\n" for line in header).encode("ascii"))
        file.write(self.rows.tobytes())


def is_cloud(path: Path) -> bool:
    """Return whether a file is a cloud that was written here."""
    if not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            return file.read(512).split(b"\n")[2:3] == [_GENERATOR.encode()]
    except OSError:
        return False


def remove_cloud(path: Path) -> None:
    """Remove a cloud that was written here before, and nothing else."""
    if is_cloud(path):
        path.unlink()


def ramp(palette: str, shares: Array) -> Array:
    """Return colours of 0 to 255 at shares of the way along a palette, shape (n, 3).

    Args:
        palette: Colours from end to end, as RRGGBB apart by spaces.
        shares: Held within 0 and 1, shape (n,).
    """
    colours = np.array(list(bytes.fromhex(palette))).reshape(-1, 3)
    places = np.clip(shares, 0.0, 1.0) * (len(colours) - 1)
    steps = np.arange(len(colours))
    return np.column_stack([np.interp(places, steps, channel) for channel in colours.T])
