"""Presets of sensor heads: what makers state, beside what their geometry gives.

Usage: python -m benchmarks.plans.heads [NAME ...]   (ringrig installed, from a
    checkout)

The stated volume is that of the preset; covered is the share of its rectangle, at its
near end, the working distance and its far end, that a projector and a camera of the
head image sharply. Sigma is the least deviation over the head's pairs of a plane across
its axis, at these three, by the formulas of `docs/method/dense.md` with the preset's
limits: noise alone. A dash stands where a maker's figure wasn't found.
"""

import sys

import numpy as np
from support.head_figures import HEADS, figures_of

from planning.model.devices.heads import Head
from planning.rig.rig import Rig, load_rig

_COLUMNS = (
    *("head", "maker", "volume: near, far [mm]", "covered [%]"),
    *("baseline stated", "computed [mm]", "points stated", "computed [mm]"),
    *("noise stated", "accuracy stated [mm]", "sigma [mm]", "angle [deg]"),
    "figures read",
)


def main(names: list[str]) -> int:
    """Print the table; return 1 if a name is no preset of a head."""
    if unknown := set(names) - set(HEADS):
        print(f"no head: {', '.join(sorted(unknown))}; there are {', '.join(HEADS)}")
        return 1
    print("| " + " | ".join(_COLUMNS) + " |")
    print("|" + len(_COLUMNS) * "---|")
    for name in HEADS:
        if name in (names or HEADS):
            print(row(name, load_rig(name)), flush=True)
    return 0


def row(name: str, rig: Rig) -> str:
    """Return a head's line of the table."""
    head, found = rig.head, figures_of(rig)
    assert head is not None
    stated = head.figures
    cells = (
        name,
        HEADS[name],
        _volume(head),
        _each(100.0 * np.array(found.covered), 0),
        _mm(stated.baseline_m, 1),
        _mm(found.baseline, 1),
        _mm(stated.point_distance_m, 3),
        _mm(found.point_distance, 3),
        _mm(stated.noise_m, 3),
        _mm(stated.accuracy_m, 3),
        _each(1e3 * np.array(found.sigma), 3),
        f"{np.degrees(found.angle):.1f}",
        _read(rig),
    )
    return "| " + " | ".join(cells) + " |"


def _volume(head: Head) -> str:
    volume = head.volume
    ends = (
        (volume.near_m, volume.near_size_m),
        (volume.far_m, volume.far_size_m),
    )
    return ", ".join(
        f"{1e3 * width:.0f} x {1e3 * height:.0f} at {1e3 * depth:.0f}"
        for depth, (width, height) in ends
    )


def _each(values: np.ndarray, digits: int) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)


def _mm(metres: float | None, digits: int) -> str:
    return "-" if metres is None else f"{1e3 * metres:.{digits}f}"


def _read(rig: Rig) -> str:
    """How many figures of head, projector and camera were read, of how many."""
    tables = (rig.table.head, rig.projector_table, rig.table.camera)
    sources = [source for table in tables if table for source in table.sources.values()]
    return f"{sum(source.startswith('read') for source in sources)} of {len(sources)}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
