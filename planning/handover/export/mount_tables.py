"""CSV: where mounts are and point to, for a builder with a tape; and exact poses."""

import csv
import io
from collections.abc import Iterable, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from geometry.arrays import Array
from geometry.poses import horizontal_axes, transform
from planning.report.summary.devices.device_lines import axis_name, standing_angles

from .exported_rig import Content, ExportedDevice, ExportedRig

# How far above the optical centre the second point is of a device without housing [m].
_ABOVE_M = 0.1
_PLACES = ("x_mm", "y_mm", "z_mm")
_MOUNTS = (
    *("name", "kind", "existing", "point", *_PLACES),
    *(f"out_{axis}" for axis in "xyz"),
    *("pan_deg", "tilt_deg", "roll_deg", "azimuth_deg", "elevation_deg"),
    *("second_point", *(f"second_{name}" for name in _PLACES)),
    *(f"centre_{name}" for name in _PLACES),
    *(f"axis_{name}" for name in _PLACES),
    *(f"to_D{k}_mm" for k in range(1, 5)),
    *(f"second_to_D{k}_mm" for k in range(1, 5)),
)
_POSES = ("name", "kind", *_PLACES, "qw", "qx", "qy", "qz")
_OPTICS = (
    *("name", "kind", "light", "width_px", "height_px", "fx_px", "fy_px", "cx_px"),
    *("cy_px", "k1", "k2", "p1", "p2", "k3", "pixel_pitch_mm"),
)


class MountTables:
    """`mounts.csv`, `poses.csv`, `optics.csv`."""

    name = "csv"
    what = "CSV of mounts and poses"
    notes = (
        "mounts.csv: millimetres to 0.01, degrees to 0.001. `x_mm` is the mount "
        "where the rig file gives one, else the optical centre (`point` says "
        "which), out_x its axis out of the device; pan, tilt and roll are the "
        "housing's, azimuth and elevation where the image's centre looks, as `plan "
        "show` counts them; `second` is a second point to measure: the middle of "
        "the housing's top, or 100 mm above the optical centre (the device's -y); "
        "`axis` is where the optical axis is at the standoff to the object's "
        "centre. to_D1_mm ...: from either point to the datum points, which are the "
        "corners of the object's bounding box on the floor (or its lowest face). "
        "Of several models a last column says which one. poses.csv: optical centres "
        "and quaternions (device to frame, OpenCV axes) with all digits, as `plan "
        "evaluate --poses` reads it; in another frame than the mesh's, which a column "
        "`frame` names, it is refused there. optics.csv: pixels; the centre of the "
        "top-left one is (0, 0). Lines that begin with # are "
        "comments."
    )

    def lacks(self, rig: ExportedRig) -> list[str]:
        """Return nothing: it holds all that plans do."""
        return []

    def files(self, rig: ExportedRig) -> dict[str, Content]:
        """Return the three tables."""
        first = axis_name(horizontal_axes(rig.up)[0])
        notes = [
            f"plan {rig.plan.digest}",
            f"frame: {rig.frame.words}",
            f"pan and azimuth count about {axis_name(rig.up)} from {first}, tilt and "
            f"elevation from the horizon, roll clockwise as the device looks",
            *(
                f"D{k}: {', '.join(f'{1e3 * x:.2f}' for x in point + 0.0)} mm"
                for k, point in enumerate(rig.datums, 1)
            ),
        ]
        devices, frame = rig.devices, [f"frame: {rig.frame.words}"]
        several = any(device.planned.model for device in devices)

        def table(
            told: Sequence[str], head: Sequence[str], rows: Iterable[list[str]]
        ) -> Content:
            if several:
                head = (*head, "model")
                models = [device.planned.model for device in devices]
                rows = ([*row, of] for row, of in zip(rows, models, strict=True))
            return _table(told, head, rows)

        names, poses = _POSES, map(_pose, devices)
        if not rig.frame.is_meshs:
            # Poses are read in the mesh's axes, and comments aren't read at all.
            names = (*names, "frame")
            poses = ([*pose, rig.frame.words] for pose in poses)
        return {
            "mounts.csv": table(notes, _MOUNTS, (_mount(d, rig) for d in devices)),
            "poses.csv": table(frame, names, poses),
            "optics.csv": table([], _OPTICS, map(_optics, devices)),
        }


def reference_point(device: ExportedDevice) -> tuple[str, Array]:
    """Return what a builder measures to, and where it is: mount or optical centre."""
    if device.world_from_mount is not None:
        return "mount", device.world_from_mount[:3, 3]
    what = "optical centre" if device.lens is not None else "centre of the panel"
    return what, device.world_from_device[:3, 3]


def _second_point(device: ExportedDevice) -> tuple[str, Array]:
    local, what = np.array([0.0, -_ABOVE_M, 0.0]), "above the optical centre"
    if device.body is not None:
        up = np.array([0.0, -device.body.half_m[1], 0.0])
        local, what = device.body.centre_m + up, "middle of the housing's top"
    return what, transform(device.world_from_device, local[None])[0]


def _mount(device: ExportedDevice, rig: ExportedRig) -> list[str]:
    what, place = reference_point(device)
    second, other = _second_point(device)
    mount, pose = device.world_from_mount, device.world_from_device
    out = [""] * 3 if mount is None else [f"{x:.5f}" for x in mount[:3, 2] + 0.0]
    angles = standing_angles(device.planned, rig.up)
    ahead = pose[:3, 3] + device.reach_m * pose[:3, 2]
    return [
        *(device.id, device.kind, device.planned.existing, what),
        *_mm(place),
        *out,
        *(f"{x:.3f}" for x in np.round(angles, 3) + 0.0),
        *(second, *_mm(other), *_mm(pose[:3, 3]), *_mm(ahead)),
        *_mm(np.linalg.norm(rig.datums - place, axis=1)),
        *_mm(np.linalg.norm(rig.datums - other, axis=1)),
    ]


def _mm(lengths_m: Array) -> list[str]:
    return [f"{x:.2f}" for x in np.round(1e3 * lengths_m, 2) + 0.0]


def _pose(device: ExportedDevice) -> list[str]:
    x, y, z, w = Rotation.from_matrix(device.world_from_device[:3, :3]).as_quat()
    place = 1e3 * device.world_from_device[:3, 3]
    return [device.id, device.kind, *(repr(float(v)) for v in (*place, w, x, y, z))]


def _optics(device: ExportedDevice) -> list[str]:
    k, (width, height) = device.panel_matrix, device.model.resolution
    size = [device.id, device.kind]
    if device.lens is None:
        pitch_mm = 1e3 / k[0, 0]
        middle = [repr(float(k[0, 2])), repr(float(k[1, 2]))]
        return [
            *(*size, "parallel", str(width), str(height), "", "", *middle),
            *("",) * 5,
            repr(float(pitch_mm)),
        ]
    lens = (k[0, 0], k[1, 1], k[0, 2], k[1, 2], *device.distortion)
    light = "diverging" if device.kind == "projector" else ""
    return [*size, light, str(width), str(height), *(repr(float(x)) for x in lens), ""]


def _table(
    notes: Sequence[str], names: Sequence[str], rows: Iterable[Sequence[str]]
) -> bytes:
    text = io.StringIO()
    text.writelines(f"# {note}\n" for note in notes)
    csv.writer(text, lineterminator="\n").writerows([names, *rows])
    return text.getvalue().encode()
