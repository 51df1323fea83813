"""What a deviation map says, in lines: the fit, the whole and each region."""

import numpy as np

from planning.verify.reconstruction.check.deviation import Deviation, RegionDeviation

_MM = 1e3
_HEADING = ("region", "points", "mean mm", "rms mm", "95 % from", "to mm", "outside")


def deviation_lines(deviation: Deviation) -> list[str]:
    """Return the table of a deviation map, under what its fit did."""
    if np.array_equal(deviation.mesh_from_measured, np.eye(4)):
        fit = "as measured, without a fit"
    else:
        fit = (
            f"after a best fit, which moved the points by "
            f"{_MM * deviation.shift_m:.3f} mm and turned them by "
            f"{np.degrees(deviation.turn_rad):.3f} degrees (--align none leaves them)"
        )
    limits = deviation.limits_m
    if limits is not None:
        low, high = (_MM * limit for limit in limits)
        fit += f"; limits {low:g} to {high:g} mm"
    names = [str(row.region) for row in deviation.by_region()]
    if names[-1] == "-1":
        names[-1] = "none"
    measured = (*deviation.by_region(), deviation.whole())
    rows = [
        _HEADING,
        *(
            _cells(name, row)
            for name, row in zip((*names, "all"), measured, strict=True)
        ),
    ]
    shown = len(_HEADING) - (limits is None)
    return [
        f"deviation from the mesh, outside positive, {fit}",
        *("".join(f"{cell:>11}" for cell in row[:shown]) for row in rows),
    ]


def _cells(name: str, row: RegionDeviation) -> tuple[str, ...]:
    lengths = (row.mean_m, row.rms_m, row.low_m, row.high_m)
    outside = "" if row.outside is None else f"{row.outside:.1%}"
    return (
        name,
        str(row.n_points),
        *(f"{_MM * length:.3f}" for length in lengths),
        outside,
    )
