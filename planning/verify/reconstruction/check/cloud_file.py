"""`cloud.ply` and `deviation.ply`: points coloured by uncertainty, or by deviation.

Positions are in the unit and axes of the mesh file, so that both lie on each other in
any viewer; the header's comments say so and give the scale to metres. Without a mesh
they are in a camera's axes.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from planning.model.document.input_records import MeshRecord
from planning.model.files import write_atomically
from planning.verify.reconstruction.arrays import Array

from .deviation import Deviation
from .merge import Merged

_GENERATOR = "comment ringrig cloud"
_PLY_TYPES = {"<f8": "double", "<f4": "float", "|u1": "uchar"}

# Every seventeenth of the 256 colours of viridis (S. van der Walt, N. Smith, CC0);
# lightness rises evenly, so that colour blindness loses nothing.
VIRIDIS = (
    "440154 481a6c 472f7d 414487 39568c 31688e 2a788e 23888e "
    "1f988b 22a884 35b779 54c568 7ad151 a5db36 d2e21b fde725"
)
# RdBu of ColorBrewer (C. Brewer, M. Harrower), reversed: safe for colour blindness too.
BLUE_TO_RED = "2166ac 4393c3 92c5de d1e5f0 f7f7f7 fddbc7 f4a582 d6604d b2182b"
# Values beyond these quantiles take the colours of the ends.
_ENDS = (0.02, 0.98)
_WIDEST = 0.95


@dataclass(frozen=True)
class ColourScale:
    """What the colours of a file mean.

    Attributes:
        column: The property that they tell.
        words: What that is.
        name: Of the palette.
        palette: Colours from end to end, as RRGGBB apart by spaces.
        names: What the colours at shares of the way are called.
    """

    column: str
    words: str
    name: str
    palette: str
    names: tuple[tuple[float, str], ...]


_BY_SIGMA = ColourScale(
    "sigma",
    "standard deviation along the normal",
    "viridis",
    VIRIDIS,
    ((0.0, "violet"), (0.5, "teal"), (1.0, "yellow")),
)
_BY_DEVIATION = ColourScale(
    "deviation",
    "signed distance from the mesh, outside positive",
    "RdBu",
    BLUE_TO_RED,
    ((0.0, "blue"), (0.5, "white"), (1.0, "red")),
)


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
    """What a file of points holds.

    Attributes:
        rows: Positions, normals, sigma, perhaps the deviation, and colours.
        unit: Of all lengths.
        scale: What the colours tell.
        limits: That at both ends of the colour scale, in that unit.
        digest: Of the plan by which it was measured.
        notes: What else the header says.
        axes: Whose axes positions are in.
    """

    rows: NDArray[np.void]
    unit: LengthUnit
    scale: ColourScale
    limits: tuple[float, float]
    digest: str = ""
    notes: tuple[str, ...] = ()
    axes: str = "the mesh"

    @classmethod
    def of(cls, merged: Merged, unit: LengthUnit, digest: str = "") -> "CloudFile":
        """Lay out a merged cloud.

        Where the normal isn't known it is 0 0 0, and sigma is the largest that any
        normal could give: the length of the point's move with its edge, times the
        edge's noise.
        """
        columns = _columns(merged.cloud.points, merged.normals, merged, unit)
        sigma = columns["sigma"].astype(float)
        low, high = np.quantile(sigma, _ENDS).tolist() if len(sigma) else (0.0, 1.0)
        return cls._coloured(columns, unit, _BY_SIGMA, (low, high), digest)

    @classmethod
    def of_deviation(
        cls, merged: Merged, deviation: Deviation, unit: LengthUnit, digest: str = ""
    ) -> "CloudFile":
        """Lay out where a cloud deviates, at the places that its fit gave it.

        Without limits the colours end where 95 % of the points are within.
        """
        away = deviation.distances / unit.in_m
        widest = float(np.quantile(np.abs(away), _WIDEST))
        low, high = deviation.limits_m or (-widest * unit.in_m, widest * unit.in_m)
        columns = _columns(deviation.points, deviation.normals, merged, unit)
        columns["deviation"] = away.astype("<f4")
        limits = low / unit.in_m, high / unit.in_m
        pose = deviation.mesh_from_measured[:3].ravel().tolist()
        moved = "moved before, rows of [R | t] in m: " + " ".join(map(repr, pose))
        file = cls._coloured(columns, unit, _BY_DEVIATION, limits, digest)
        return replace(file, notes=(moved,))

    @classmethod
    def _coloured(
        cls,
        columns: dict[str, NDArray[Any]],
        unit: LengthUnit,
        scale: ColourScale,
        limits: tuple[float, float],
        digest: str,
    ) -> "CloudFile":
        low, high = limits
        shares = (columns[scale.column] - low) / max(high - low, 1e-300)
        shades = np.rint(ramp(scale.palette, shares)).astype("u1")
        channels = ("red", "green", "blue")
        columns |= dict(zip(channels, shades.T, strict=True))
        kinds = [(name, column.dtype) for name, column in columns.items()]
        rows = np.empty(len(shades), dtype=kinds)
        for name, column in columns.items():
            rows[name] = column
        return cls(rows, unit, scale, limits, digest)

    @property
    def legend(self) -> str:
        """What the colours mean, in one line."""
        low, high = self.limits
        return ", ".join(
            f"{name} {low + share * (high - low):.4g} {self.unit.name}"
            for share, name in self.scale.names
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
            f"comment unit {self.unit.name}, {self.unit.in_m!r} m; axes of {self.axes}",
            *([f"comment plan {self.digest}"] if self.digest else []),
            f"comment {self.scale.column}: {self.scale.words}, same unit",
            f"comment colour {self.scale.name} by {self.scale.column}, {low:.6g} to "
            f"{high:.6g}: {self.legend}",
            *(f"comment {note}" for note in self.notes),
            f"element vertex {len(self.rows)}",
            *(
                f"property {_PLY_TYPES[self.rows.dtype[name].str]} {name}"
                for name in self.rows.dtype.names or ()
            ),
            "end_header",
        ]
        file.write("".join(f"{line}\n" for line in header).encode("ascii"))
        file.write(self.rows.tobytes())


def _noise(merged: Merged) -> Array:
    """Standard deviations of noise along the normal, without one the largest [m]."""
    cloud = merged.cloud
    largest = np.linalg.norm(cloud.shift, axis=1) * np.hypot(
        cloud.noise_px, cloud.bias_px
    )
    return np.where(np.isfinite(merged.normals[:, 0]), merged.sigma, largest)


def _columns(
    points: Array, normals: Array, merged: Merged, unit: LengthUnit
) -> dict[str, NDArray[Any]]:
    """Positions, normals and sigma; its parts where a calibration is stated."""
    normals = np.where(np.isfinite(normals), normals, 0.0)
    columns = {name: points[:, k] / unit.in_m for k, name in enumerate("xyz")}
    columns |= {f"n{name}": normals[:, k].astype("<f4") for k, name in enumerate("xyz")}
    noise, calibration = _noise(merged), merged.calibration
    sigmas = {"sigma": np.hypot(noise, calibration)}
    if np.any(calibration > 0.0):
        sigmas |= {"sigma_noise": noise, "sigma_calibration": calibration}
    return columns | {k: (v / unit.in_m).astype("<f4") for k, v in sigmas.items()}


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
