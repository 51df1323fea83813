"""Tables of what stands where: poses, mounts, rings, the sequence and baselines."""

from collections.abc import Iterator

import numpy as np

from planning.model.document.device_records import ProjectorRecord
from planning.model.plan import RigPlan
from planning.model.words import area_words, percent, tenths
from planning.report.summary.coverage_lines import schedule_lines
from planning.report.summary.devices.device_lines import axis_name, gap_lines, standing
from planning.rings.acquisition import n_frames

from .markup import table


def device_tables(plan: RigPlan) -> Iterator[str]:
    """Yield the tables of a plan's devices."""
    yield _poses(plan)
    yield _mounts(plan)
    yield _rings(plan)
    yield _codes(plan)
    yield _sequence(plan)
    yield _baselines(plan)


def _poses(plan: RigPlan) -> str:
    up = plan.requirements.workspace.up
    areas = {p.id: (p.lit_area_m2, None) for p in plan.document.projectors}
    areas |= {c.id: (c.seen_area_m2, c.sole_area_m2) for c in plan.document.cameras}
    rows: list[list[str]] = []
    several = any(device.model for device in (*plan.projectors, *plan.cameras))
    for device, (*numbers, distance) in standing(plan):
        near, far = device.device.range_m
        covered, sole = areas[device.id]
        rows.append(
            [
                device.id + (f" ({device.existing})" if device.existing else ""),
                *([device.model] if several else []),
                *(f"{number:.1f}" for number in tenths(numbers)),
                f"{distance:.1f}",
                f"{1e3 * near:.0f} to {1e3 * far:.0f}",
                " x ".join(map(str, device.device.resolution)),
                area_words(covered),
                "" if sole is None else area_words(sole),
            ]
        )
    head = ["device", *(["model"] if several else []), "x [mm]", "y [mm]", "z [mm]"]
    head += ["pan [deg]", "tilt [deg]"]
    head += ["roll [deg]", "aim azimuth [deg]", "aim elevation [deg]"]
    head += ["standoff to centre [mm]", "sharp [mm]", "pixels"]
    head += ["target lit or measured", "by it alone"]
    nearest = "".join(f" {line.strip()}." for line in gap_lines(plan))
    note = (
        f"In the axes of the mesh file; up is {axis_name(up)}. Pan and azimuth count "
        f"about it, tilt and elevation from the horizon; roll is clockwise as the "
        f"device looks. The middle of the image aims elsewhere than the housing "
        f"where the lens is shifted.{nearest}"
    )
    return table("Devices and their poses", head, rows, note)


def _mounts(plan: RigPlan) -> str:
    rows: list[list[str]] = []
    for record in (*plan.document.projectors, *plan.document.cameras):
        if record.world_from_mount is None:
            continue
        pose = np.array(record.world_from_mount)
        place = [f"{x:.1f}" for x in tenths(1e3 * pose[:3, 3])]
        ways = [
            ", ".join(f"{x:.4f}" for x in np.round(pose[:3, axis], 4) + 0.0)
            for axis in (2, 0)
        ]
        rows.append([record.id, *place, *ways])
    head = ("device", "x [mm]", "y [mm]", "z [mm]", "axis, out of it", "forward")
    return table("Mounts", head, rows)


def _codes(plan: RigPlan) -> str:
    """What tells the pixels of each projector; empty where rings do."""
    rows = [
        [
            record.id,
            f"{record.resolution[0]} x {record.resolution[1]}",
            " + ".join(str(code.bits(n)) for n in record.resolution),
            str(code.shifts) if code.shifts else "none",
            str(code.period_px) if code.shifts else "",
            str(code.n_frames(record.resolution)),
            _exposure(record),
        ]
        for record in plan.document.projectors
        if (code := record.code) is not None
    ]
    if not rows:
        return ""
    head = ("projector", "pixels", "Gray code bits", "shifts", "period [px]")
    return table("Codes", (*head, "frames", "exposure [ms]"), rows)


def _exposure(record: ProjectorRecord) -> str:
    exposure = record.exposure
    return "" if exposure is None else f"{1e3 * exposure.exposure_s:.1f}"


def _rings(plan: RigPlan) -> str:
    rows: list[list[str]] = []
    for record in plan.document.projectors:
        shares, rings = record.ring_shares, record.rings
        gap = None if rings is None else rings.gap_m
        by_ring = () if shares is None else (shares.on_object, shares.measured)
        if record.code is not None:
            continue
        rows.append(
            [
                record.id,
                str(len(record.ring_radii)),
                str(n_frames((record.planned(),), len(plan.cameras))),
                "" if gap is None else f"{1e3 * gap[0]:.1f} to {1e3 * gap[1]:.1f}",
                *(percent(float(np.mean(values))) for values in by_ring),
                *("" for _ in range(2 - len(by_ring))),
                _exposure(record),
            ]
        )
    if plan.document.projectors and not rows:
        return ""
    head = ("projector", "rings", "frames", "apart on the object [mm]")
    head += ("of a ring on the object", "of a ring measured", "exposure [ms]")
    return table("Rings", head, rows)


def _sequence(plan: RigPlan) -> str:
    schedule = plan.document.firing_schedule
    if schedule is None:
        return ""
    rows = [[str(k), ", ".join(group)] for k, group in enumerate(schedule.groups, 1)]
    note = " ".join(schedule_lines(plan.document)).removeprefix("FIRING").strip()
    return table("Exposure sequence", ("step", "projectors that shine"), rows, note)


def _baselines(plan: RigPlan) -> str:
    rows = [
        [
            " - ".join(row.cameras),
            f"{1e3 * row.d:.1f}",
            "" if row.d_max is None else f"{1e3 * row.d_max:.1f}",
            f"{np.degrees(row.phi):.1f}",
            f"{np.degrees(row.phi_max):.1f}",
            f"{np.degrees(row.slack):.1f}",
            "yes" if row.covered else "no",
            row.limit,
        ]
        for row in plan.document.baselines
    ]
    head = ("cameras", "d [mm]", "largest d [mm]", "phi [deg]", "largest phi [deg]")
    head += ("slack [deg]", "covered", "limited by")
    note = "The tightest seam point of each pair, eqs. (9) and (10) of the paper."
    return table("Baselines", head, rows, note)
