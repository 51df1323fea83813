"""Every export read back by the other side's own code: how far points re-project.

1,000 points a device that fill its image and depth, of a plan with lens shift in both
axes, pixels that aren't square, distortion, parallel light, a camera that looks
straight down, mounts and housings; in the mesh's axes and in a turned frame.

    python -m benchmarks.exports.read_back [--blender PYTHON] [DIR ...]

Of plans in folders instead: what `plan export DIR --to all` wrote, and its exit code.
With PYTHONPATH=.:tests. Readers: pip install 'ringrig[exports-check,render]'; those
that are missing are told. Blender's `bpy` needs another numpy than ours: give the
interpreter of an environment that has it.

Blender and Mitsuba compute in single precision, so each has a row in double too: of
the numbers in the file, and of those that Blender keeps of them.
"""

import argparse
import json
import os
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
from click.testing import CliRunner
from numpy.typing import NDArray
from support import camera_readers as cameras
from support import double_readers as doubles
from support import solid_readers as solids
from support.exported_plans import exported_plan, points_before

from planning.cli.main import commands
from planning.handover.export.export_formats import FORMATS
from planning.handover.export.export_frames import frame_of
from planning.handover.export.exported_rig import ExportedDevice, ExportedRig
from planning.handover.export.mitsuba_export import mitsuba_lacks, write_mitsuba
from planning.handover.export.write_exports import write_export
from planning.model.plan import RigPlan
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
    ("mitsuba", doubles.mitsuba_in_double, ("mitsuba",), _pinhole),
    ("mitsuba", doubles.mitsuba_in_double, ("mitsuba",), _beam),
    ("mitsuba", cameras.mitsuba, ("mitsuba",), _pinhole),
    ("mitsuba", cameras.mitsuba, ("mitsuba",), _beam),
    ("blender", doubles.blender_in_double, (), _straight),
)
SOLIDS = (
    ("step", solids.step_gmsh, ("gmsh",)),
    ("step", solids.step_opencascade, ("cadquery-ocp",)),
    ("drawing", solids.dxf, ("ezdxf",)),
    ("csv", solids.mounts, ()),
)


Written = list[tuple[ExportedRig, Path]]


def main() -> None:
    """Print both tables of each plan, and what each format says it can't hold."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--blender", metavar="PYTHON")
    options = parser.parse_args()
    print("1,000 points a device", end="" if not options.folders else "\n")
    with tempfile.TemporaryDirectory() as place:
        if not options.folders:
            print(f"; the turned frame is --frame {TURNED}\n")
            _tables(("mesh axes", "turned frame"), _made(Path(place)), options.blender)
        for k, folder in enumerate(options.folders):
            print(f"\n## {folder.name}\n")
            written = _exported(folder, Path(place) / str(k))
            _tables(("mesh axes",), written, options.blender)


def _made(place: Path) -> Written:
    """Write a plan made for this, in two frames, and print what formats lack."""
    plan = exported_plan()
    written: Written = []
    lacks: dict[str, list[str]] = {}
    for name in (None, TURNED):
        rig = ExportedRig.of(plan, frame_of(name, plan.requirements.workspace))
        folder = place / ("turned" if name else "mesh")
        for form in FORMATS:
            done = write_export(rig, form, folder / form.name)
            lacks[form.name] = list(done.lacks)
        write_mitsuba(rig, folder / "mitsuba", Surface(), None)
        lacks["mitsuba"] = mitsuba_lacks(rig)
        written.append((rig, folder))
    print("What the formats say that they can't hold of this plan:\n")
    for form, sentences in lacks.items():
        print(f"- {form}: {'; '.join(sentences) or 'nothing'}")
    return written


def _exported(folder: Path, place: Path) -> Written:
    """Let the command write a plan's exports; print its exit code and sentences."""
    words = ["export", str(folder), "--to", "all", "--quiet", "--json"]
    ended = CliRunner().invoke(commands, [*words, "-o", str(place)])
    print(f"`plan export DIR --to all` ends with {ended.exit_code}; left out:\n")
    for each in json.loads(ended.stdout)["exports"]:
        print(f"- {each['format']}: {'; '.join(each['left_out']) or 'nothing'}")
    plan = RigPlan.load(folder / "plan.json")
    rig = ExportedRig.of(plan, frame_of(None, plan.requirements.workspace))
    return [(rig, place)]


def _tables(frames: tuple[str, ...], written: Written, blender: str | None) -> None:
    print(f"\n| format | reader | devices | {' [px] | '.join(frames)} [px] |")
    print("|---|---|---|" + "---|" * len(frames))
    for row in ROWS:
        rig, folder = written[0]
        # The command leaves a format out that can hold nothing of a plan.
        if (folder / row[0]).exists() and any(map(row[3], rig.devices)):
            print(_line(row, written), flush=True)
    if blender is not None:
        print(_line(("blender", partial(_kept, blender), (), _straight), written))
        print(_line(("blender", _by_blender, (), _straight), written))
        with np.load(written[-1][1] / "blender" / "pixels.npz") as told:
            print(f"\nbpy is Blender {told['version']}; {told['light']}")
    print(f"\n| format | reader | compared | {' [mm] | '.join(frames)} [mm] |")
    print("|---|---|---|" + "---|" * len(frames))
    for name, reader, packages in SOLIDS:
        print(_solid(name, reader, packages, written), flush=True)


def _kept(interpreter: str, folder: Path, points: cameras.Points) -> dict[str, Array]:
    """By the numbers that Blender keeps after it ran the script, in double."""
    np.savez(folder / "points.npz", **points)
    inside = str(Path(__file__).parent / "inside_blender.py")
    # Our packages aren't that interpreter's.
    alone = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    command = [interpreter, inside, str(folder)]
    subprocess.run(command, check=True, env=alone, capture_output=True)
    numbers = json.loads((folder / "kept.json").read_text())
    return {
        name: doubles.blender_pixels(points[name], each["pose"], each)
        for name, each in numbers.items()
    }


def _by_blender(folder: Path, points: cameras.Points) -> dict[str, Array]:
    """By `world_to_camera_view`, of the run before."""
    with np.load(folder / "pixels.npz") as pixels:
        return {name: pixels[name] for name in points}


def _line(row: Row, written: Written) -> str:
    name, reader, _, holds = row
    offs: list[str] = []
    held: list[str] = []
    try:
        for rig, folder in written:
            held, off = _worst(rig, partial(reader, folder / name), holds)
            offs.append(f"{off:.1e}")
    except ImportError as error:
        offs = [f"not read: {error.name} is missing", ""]
    return f"| {name} | {_reader(row)} | {', '.join(held)} | {' | '.join(offs)} |"


def _reader(row: Row) -> str:
    _, reader, packages, _ = row
    called = reader.func if isinstance(reader, partial) else reader
    return f"`{called.__name__.strip('_')}` {_versions(packages)}".strip()


def _worst(
    rig: ExportedRig,
    read: Callable[[cameras.Points], dict[str, Array]],
    holds: Callable[[ExportedDevice], bool],
) -> tuple[list[str], float]:
    """Return which devices were read, and the largest difference [px]."""
    points = {device.id: points_before(device) for device in rig.devices}
    found = read(points)
    held = [device for device in rig.devices if device.id in found and holds(device)]
    if not held:
        raise ValueError(f"of {', '.join(points)} none was read")
    offs = [np.abs(found[d.id] - d.project(points[d.id])).max() for d in held]
    return [device.id for device in held], float(np.max(offs))


def _solid(
    name: str,
    reader: Callable[[Path, ExportedRig], tuple[float, str]],
    packages: tuple[str, ...],
    written: Written,
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
