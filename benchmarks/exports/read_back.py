"""Every export read back by the other side's own code: how far points re-project.

1,000 points a device that fill its image and depth, of a plan with lens shift in both
axes, pixels that aren't square, distortion, parallel light, a camera that looks
straight down, mounts and housings; in the mesh's axes and in a turned frame.

    PYTHONPATH=.:tests python -m benchmarks.exports.read_back [BLENDER_PYTHON]

Readers: pip install 'ringrig[exports-check,render]'; those that are missing are told.
Blender's `bpy` needs another numpy than ours: give the interpreter of an environment
that has it.
"""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from support import camera_readers as cameras
from support import solid_readers as solids
from support.exported_plans import exported_plan, points_before

from planning.handover.export.export_formats import FORMATS
from planning.handover.export.export_frames import frame_of
from planning.handover.export.exported_rig import ExportedDevice, ExportedRig
from planning.handover.export.mitsuba_export import mitsuba_lacks, write_mitsuba
from planning.handover.export.write_exports import write_export
from planning.verify.reconstruction.render.mitsuba.materials import Surface

Array = NDArray[np.float64]
Reader = Callable[[Path, cameras.Points], dict[str, Array]]
TURNED = "100,-50,30,40,20,-10"


def _all(device: ExportedDevice) -> bool:
    return True


def _straight(device: ExportedDevice) -> bool:
    return not any(device.distortion)


def _plain(device: ExportedDevice) -> bool:
    return _straight(device) and not device.lens_shift.any()


def _pinhole(device: ExportedDevice) -> bool:
    return _straight(device) and device.lens is not None


def _beam(device: ExportedDevice) -> bool:
    return device.lens is None


# Format, reader, the packages behind it, and which devices are held against the plan.
Row = tuple[str, Reader, tuple[str, ...], Callable[[ExportedDevice], bool]]
ROWS: tuple[Row, ...] = (
    ("opencv", cameras.opencv, ("opencv-python-headless",), _all),
    ("colmap", cameras.colmap_text, ("pycolmap",), _all),
    ("colmap", cameras.colmap_binary, ("pycolmap",), _all),
    ("gltf", cameras.gltf_extras, ("pygltflib", "opencv-python-headless"), _all),
    ("gltf", cameras.gltf_cameras, ("trimesh", "pygltflib"), _plain),
    ("ros", cameras.ros, ("yourdfpy", "opencv-python-headless"), _all),
    ("ros", cameras.ros_transforms, ("opencv-python-headless",), _all),
    ("usd", cameras.usd_frustum, ("usd-core",), _straight),
    ("usd", cameras.usd_attributes, ("usd-core", "opencv-python-headless"), _all),
    ("csv", cameras.tables, ("opencv-python-headless",), _all),
    ("mitsuba", cameras.mitsuba, ("mitsuba",), _pinhole),
    ("mitsuba", cameras.mitsuba, ("mitsuba",), _beam),
)
SOLIDS = (
    ("step", solids.step_gmsh, ("gmsh",)),
    ("step", solids.step_opencascade, ("cadquery-ocp",)),
    ("drawing", solids.dxf, ("ezdxf",)),
    ("csv", solids.mounts, ()),
)


def main() -> None:
    """Print both tables, and what each format says it can't hold."""
    plan = exported_plan()
    with tempfile.TemporaryDirectory() as place:
        written: list[tuple[ExportedRig, Path]] = []
        lacks: dict[str, list[str]] = {}
        for name in (None, TURNED):
            rig = ExportedRig.of(plan, frame_of(name, plan.requirements.workspace))
            folder = Path(place) / ("turned" if name else "mesh")
            for form in FORMATS:
                done = write_export(rig, form, folder / form.name)
                lacks[form.name] = list(done.lacks)
            write_mitsuba(rig, folder / "mitsuba", Surface(), None)
            lacks["mitsuba"] = mitsuba_lacks(rig)
            written.append((rig, folder))
        print(f"1,000 points a device; the turned frame is --frame {TURNED}\n")
        print("| format | reader | devices | mesh axes [px] | turned frame [px] |")
        print("|---|---|---|---|---|")
        for row in ROWS:
            print(_line(row, written), flush=True)
        for interpreter in sys.argv[1:2]:
            print(_line(_blender(interpreter), written))
            with np.load(written[1][1] / "blender" / "pixels.npz") as told:
                print(f"\nbpy is Blender {told['version']}; {told['light']}")
        print("\n| format | reader | compared | mesh axes [mm] | turned frame [mm] |")
        print("|---|---|---|---|---|")
        for name, reader, packages in SOLIDS:
            print(_solid(name, reader, packages, written), flush=True)
        print("\nWhat the formats say that they can't hold of this plan:\n")
        for name, sentences in lacks.items():
            print(f"- {name}: {'; '.join(sentences) or 'nothing'}")


def _blender(interpreter: str) -> Row:
    def by_blender(folder: Path, points: cameras.Points) -> dict[str, Array]:
        """By `world_to_camera_view` of a Blender that ran the script."""
        np.savez(folder / "points.npz", **points)
        inside = str(Path(__file__).parent / "inside_blender.py")
        # Our packages aren't that interpreter's.
        alone = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
        subprocess.run(
            [interpreter, inside, str(folder)],
            check=True,
            env=alone,
            capture_output=True,
        )
        with np.load(folder / "pixels.npz") as pixels:
            return {name: pixels[name] for name in points}

    return "blender", by_blender, (), _straight


def _line(row: Row, written: list[tuple[ExportedRig, Path]]) -> str:
    name, reader, packages, holds = row
    offs: list[str] = []
    held: list[str] = []
    try:
        for rig, folder in written:
            held, off = _worst(rig, partial(reader, folder / name), holds)
            offs.append(f"{off:.1e}")
    except ImportError as error:
        offs = [f"not read: {error.name} is missing", ""]
    words = f"`{reader.__name__}` {_versions(packages)}".strip()
    return f"| {name} | {words} | {', '.join(held)} | {' | '.join(offs)} |"


def _worst(
    rig: ExportedRig,
    read: Callable[[cameras.Points], dict[str, Array]],
    holds: Callable[[ExportedDevice], bool],
) -> tuple[list[str], float]:
    """Return which devices were read, and the largest difference [px]."""
    points = {device.id: points_before(device) for device in rig.devices}
    found = read(points)
    held = [device for device in rig.devices if device.id in found and holds(device)]
    offs = [np.abs(found[d.id] - d.project(points[d.id])).max() for d in held]
    return [device.id for device in held], float(np.max(offs))


def _solid(
    name: str,
    reader: Callable[[Path, ExportedRig], tuple[float, str]],
    packages: tuple[str, ...],
    written: list[tuple[ExportedRig, Path]],
) -> str:
    offs: list[str] = []
    compared = ""
    try:
        for rig, folder in written:
            off, compared = reader(folder / name, rig)
            offs.append(f"{off:.1e}")
    except ImportError as error:
        offs = [f"not read: {error.name} is missing", ""]
    words = f"`{reader.__name__}` {_versions(packages)}".strip()
    return f"| {name} | {words} | {compared} | {' | '.join(offs)} |"


def _versions(packages: tuple[str, ...]) -> str:
    def words() -> Iterator[str]:
        for package in packages:
            try:
                yield f"{package} {version(package)}"
            except ImportError:
                yield package

    return ", ".join(words())


if __name__ == "__main__":
    main()
