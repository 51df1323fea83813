"""The head, the turntable and the stations of a rig, and whether they can be."""

import re
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from geometry.arrays import Array, Mask
from geometry.devices import DeviceModel, PinholeModel
from geometry.poses import inverse
from planning.model.devices.heads import Head, HeadDevice, Kind, Stations, Turntable
from planning.rig.rig_tables import RigTable

from .models import Model, named

Optics = Callable[[Kind, str], DeviceModel]
# Shares of the volume below which a user is told: the maker's field is another.
_MOST_OF_IT = 0.9
_OWN = ("body", "mount", "count")
# As plans name what stands still about a turntable at its steps.
_STEP = re.compile(r" \(T\d+\)$")


def head_of(table: RigTable, optics: Optics) -> Head | None:
    """Return the head of a rig in metres; None: it has none."""
    return None if table.head is None else table.head.head(optics)


def turntable_of(table: RigTable) -> Turntable | None:
    """Return the turntable; its point counts from where places of the file do."""
    if table.turntable is None:
        return None
    zones = [zone.name for zone in table.workspace.keep_out if zone.blocks]
    return table.turntable.turntable(zones)


def stations_of(table: RigTable) -> Stations | None:
    """Return the stations of a rig's head; None: it isn't carried."""
    return None if table.stations is None else table.stations.stations()


def sees(device: HeadDevice, optics: DeviceModel, points: Array) -> Mask:
    """Return which points (n, 3) of the head's frame a device images sharply."""
    device_from_head = inverse(device.head_from_device)
    local = points @ device_from_head[:3, :3].T + device_from_head[:3, 3]
    return optics.in_field(local) & _sharp(optics, local)


def seen_share(head: Head, optics: Optics, points: Array) -> float:
    """Return which share of points (n, 3) some pair of the head's devices images."""
    seen = {
        device: sees(device, optics(device.kind, device.model), points)
        for device in head.devices
    }
    pairs = [seen[lamp] & seen[eye] for lamp, eye in head.pairs]
    return float(np.logical_or.reduce(pairs).mean())


def model_faults(
    table: RigTable, models: Callable[[Kind], Sequence[Model]]
) -> list[str]:
    """Return a sentence for each table that a head makes void, or that lacks one."""
    return [*_carried(table), *_unmodelled(table, models)]


def head_faults(head: Head, optics: Optics) -> Iterator[str]:
    """Yield a sentence for each device and pair that doesn't measure its volume."""
    points, seen = head.volume.samples(), dict[HeadDevice, Mask]()
    for device in head.devices:
        lens = optics(device.kind, device.model)
        seen[device] = sees(device, lens, points)
        if not seen[device].any():
            yield _blind(device, lens, points)
    for lamp, eye in head.pairs:
        # Who sees nothing is told already.
        if seen[lamp].any() and seen[eye].any() and not (seen[lamp] & seen[eye]).any():
            yield (
                f"[head] {lamp.name!r} and {eye.name!r} share nothing of the measuring "
                f"volume; turn them towards its middle, or leave one out"
            )


def head_notes(head: Head, optics: Optics) -> Iterator[str]:
    """Yield what a user of a head should know, a sentence each."""
    share = seen_share(head, optics, head.volume.samples())
    if share < _MOST_OF_IT:
        yield (
            f"head {head.name}: its devices image {100.0 * share:.0f} % of the "
            f"measuring volume that is stated, sharply and in pairs"
        )


def _carried(table: RigTable) -> Iterator[str]:
    """What of [stations], [turntable] and models can't be beside the rest."""
    if table.head is None and table.stations is not None:
        yield "[stations] are poses of a head that is carried; write [head]"
    known = {obstacle.name for obstacle in table.obstacle}
    for name in table.turntable.still if table.turntable else ():
        if name not in known:
            names = ", ".join(map(repr, sorted(known))) or "none"
            yield (
                f"[turntable] still names {name!r}, which is no [[obstacle]]; there "
                f"are: {names}. Keep-out volumes stand still anyway"
            )
    solid = known | {zone.name for zone in table.workspace.keep_out}
    for name in sorted(solid) if table.turntable else ():
        if _STEP.search(name):
            yield (
                f"{name!r} is named as what stands still is named at a "
                f"step of the [turntable]; call it otherwise"
            )
    if table.head is None:
        return
    for key in ("camera", "projector", "parallel_projector"):
        for device in (getattr(table, key), *getattr(table, f"more_{key}s")):
            for own in _OWN:
                if device is not None and getattr(device, own) is not None:
                    instead = "write [head.body]" if own == "body" else "remove it"
                    yield (
                        f"[{key}] has {own}, and stands in a [head], which is one "
                        f"rigid body; {instead}"
                    )


def _unmodelled(
    table: RigTable, models: Callable[[Kind], Sequence[Model]]
) -> Iterator[str]:
    for kind, device in table.head.devices if table.head else ():
        if named(models(kind), device.model) is None:
            names = ", ".join(repr(model.table.name) for model in models(kind))
            yield (
                f"[head] {device.name!r}: model = {device.model!r} is none of the "
                f"rig's {kind}s; name one of {names}"
            )


def _sharp(optics: DeviceModel, local: Array) -> Mask:
    near, far = optics.range_m
    pinhole = isinstance(optics, PinholeModel)
    away = np.linalg.norm(local, axis=-1) if pinhole else local[..., 2]
    return (away >= near) & (away <= far)


def _blind(device: HeadDevice, optics: DeviceModel, points: Array) -> str:
    """Why a device images nothing of the volume."""
    device_from_head = inverse(device.head_from_device)
    local = points @ device_from_head[:3, :3].T + device_from_head[:3, 3]
    if not optics.in_field(local).any():
        return (
            f"[head] {device.kind} {device.name!r} looks away from the measuring "
            f"volume: none of it lies in its image; correct aim_mm or pose_mm"
        )
    away = np.linalg.norm(local, axis=-1)
    near, far = (1e3 * end for end in optics.range_m)
    return (
        f"[head] {device.kind} {device.name!r} is sharp from {near:.0f} to {far:.0f} "
        f"mm, the measuring volume is {1e3 * away.min():.0f} to {1e3 * away.max():.0f} "
        f"mm away; correct range_mm, the focus, or the volume"
    )
