"""Heads, stations and steps of a turntable, for a person."""

from collections.abc import Iterator

import numpy as np

from geometry.arrays import Array
from geometry.poses import pan_tilt_roll
from planning.model.document.plan_document import PlanDocument
from planning.model.document.station_records import (
    StationRecord,
    StationsRecord,
    TradeRow,
)
from planning.model.plan import RigPlan
from planning.model.words import count_words, labelled, tenths

# What a station is called, by kind.
STATIONS = {"heads": "head", "stations": "station", "turntable": "step"}
_MOST = 8
_HEADING = "position x, y, z [mm] of the head's origin   pan    tilt    roll   devices"


def fewest_words(plan: RigPlan) -> str:
    """Return what is known of fewer heads, stations or steps; empty without any."""
    told = plan.document.stations
    if told is None or told.count is None:
        return ""
    count, word = told.count, STATIONS[told.kind]
    over = f"over {count.n_candidates} candidates"
    if count.needed is None:
        return (
            f"at least {count.lower_bound} {word}s claimed {over}; none were found "
            f"that are enough and whose housings keep off each other"
        )
    if count.needed > count.count:
        return (
            f"at least {count.lower_bound} {word}s claimed {over}, {count.needed} "
            f"suffice; at most {count.count} was asked"
        )
    found = count_words(count.count, word)
    if count.lower_bound >= count.count:
        text = f"{found}: claimed to be the fewest {over}"
    else:
        more = ""
        if count.needed < count.count:
            more = f", of which {count.needed} suffice for the planner's own samples"
        text = f"{found}{more}; at least {count.lower_bound} claimed {over}"
    if count.everywhere is not None:
        text += f"; over every pose at least {count.everywhere}, by their light"
    return text


def device_counts(plan: RigPlan) -> tuple[int, int]:
    """Return how many projectors and cameras there are, moved ones counted once."""
    told = plan.document.stations
    if told is None or told.kind == "heads" or not told.stations:
        return len(plan.projectors), len(plan.cameras)
    one = told.stations[0]
    return len(one.projectors), len(one.cameras)


def station_lines(plan: RigPlan) -> list[str]:
    """Return every station with its devices, and what trades against what."""
    told = plan.document.stations
    if told is None:
        return []
    label, up = f"{STATIONS[told.kind].upper()}S", plan.requirements.workspace.up
    lines = [title_words(plan.document)]
    if told.kind != "turntable":
        lines.append(_HEADING)
    lines += [_row(one, np.array(up)) for one in told.stations]
    return ["", *labelled(label, [*lines, *trade_lines(told)])]


def _row(one: StationRecord, up: Array) -> str:
    """A station: the pose of the head, or how far the table has turned; its devices."""
    devices = ", ".join((*one.projectors, *one.cameras))
    if one.angle is not None:
        return f"{one.id:<4} {np.degrees(one.angle):9.4g} degrees   {devices}"
    pose = np.array(one.world_from_station)
    x, y, z = tenths(1e3 * pose[:3, 3])
    pan, tilt, roll = tenths(np.degrees(pan_tilt_roll(pose[:3, :3], up)))
    place = f"{one.id:<4} {x:9.1f} {y:9.1f} {z:9.1f}"
    return f"{place}  {pan:9.1f} {tilt:7.1f} {roll:7.1f}   {devices}"


def title_words(document: PlanDocument) -> str:
    """Return what stands at the stations, in a sentence; empty where there are none."""
    told, carried = document.stations, document.rig.stations
    if told is None:
        return ""
    n, word = len(told.stations), STATIONS[told.kind]
    if told.kind == "turntable":
        angles = [one.angle for one in told.stations if one.angle is not None]
        shown = ", ".join(f"{np.degrees(a):.4g}" for a in angles[:_MOST])
        more = ", ..." if len(angles) > _MOST else ""
        return f"{count_words(n, word)} of the table at {shown}{more} degrees"
    across = ", pairs across heads count" if told.cross else ""
    if told.kind == "heads":
        return f"{count_words(n, word)} {told.head}{across}"
    way = (
        "" if told.way_m is None else f", {1e3 * told.way_m:.0f} mm from first to last"
    )
    by = "" if carried is None else f" on a {carried.carrier}"
    return f"{count_words(n, word)} of one {told.head}{by}{way}"


def trade_lines(told: StationsRecord) -> list[str]:
    """Return the fewest steps, or stations, for other numbers of devices."""
    if told.kind == "stations" and told.count is not None:
        return list(_heads_or_stations(told.count.count))
    return list(_steps(told.steps))


def _heads_or_stations(count: int) -> Iterator[str]:
    """How many stations several heads of the kind leave to each of them."""
    rows = {heads: -(-count // heads) for heads in range(1, count + 1)}
    shown = [h for h, n in rows.items() if h == 1 or n < rows[h - 1]]
    yield "heads     " + " ".join(f"{heads:>4}" for heads in shown)
    yield "stations  " + " ".join(f"{rows[heads]:>4}" for heads in shown)


def _steps(rows: tuple[TradeRow, ...]) -> Iterator[str]:
    if not rows:
        return
    yield "projectors  cameras  fewest steps  at least"
    for row in rows:
        steps = "none" if row.steps is None else str(row.steps)
        devices = f"{row.projectors:>10}  {row.cameras:>7}"
        yield f"{devices}  {steps:>12}  {row.lower_bound:>8}"


def moves_words(document: PlanDocument) -> str:
    """Say what moves from one station to the next take; empty where it isn't known."""
    told = document.stations
    if told is None or told.move_s is None:
        return ""
    return f", and {told.move_s:.1f} s to move between {STATIONS[told.kind]}s"
