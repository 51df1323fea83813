"""Places by other programs' own code, from the files of an export that have no lens.

Each function takes a folder and the rig, and returns the largest distance [mm] between
what was read and what the plan has, and what was compared.
"""

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planning.handover.export.exported_rig import ExportedRig
from planning.handover.export.mount_tables import reference_point

Array = NDArray[np.float64]


def step_gmsh(folder: Path, rig: ExportedRig) -> tuple[float, str]:
    """By gmsh (OpenCASCADE's reader): the corners of every solid."""
    import gmsh

    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
    gmsh.open(str(folder / "rig.step"))
    worst = 0.0
    solids = gmsh.model.getEntities(3)
    boxes = [device.box for device in rig.devices if device.box is not None]
    if len(solids) != len(boxes):
        raise ValueError(f"{len(solids)} solids of {len(boxes)} housings")
    for solid, box in zip(solids, boxes, strict=True):
        corners = gmsh.model.getBoundary([solid], recursive=True)
        read = np.array([gmsh.model.getValue(0, tag, []) for _, tag in corners])
        worst = max(worst, _apart(read, 1e3 * box.corners))
    gmsh.finalize()
    return worst, f"{len(solids)} solids, their corners"


def step_opencascade(folder: Path, rig: ExportedRig) -> tuple[float, str]:
    """By OpenCASCADE itself (cadquery-ocp): solids are valid, corners and wires."""
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_SOLID
    from OCP.TopExp import TopExp_Explorer

    reader = STEPControl_Reader()
    reader.ReadFile(str(folder / "rig.step"))
    reader.TransferRoots()
    shape = reader.OneShape()
    volumes: list[float] = []
    each = TopExp_Explorer(shape, TopAbs_SOLID)
    while each.More():
        if not BRepCheck_Analyzer(each.Current()).IsValid():
            raise ValueError("a solid isn't valid")
        found = GProp_GProps()
        BRepGProp.VolumeProperties_s(each.Current(), found)
        volumes.append(found.Mass())
        each.Next()
    wires = 0
    each = TopExp_Explorer(shape, TopAbs_EDGE, TopAbs_SOLID)
    while each.More():
        wires += 1
        each.Next()
    want = [8e9 * np.prod(d.box.half) for d in rig.devices if d.box is not None]
    # Of a volume the side of a cube that would be as much larger.
    off = np.abs(np.cbrt(volumes) - np.cbrt(want)).max(initial=0.0)
    return float(off), f"{len(volumes)} valid solids, their volumes; {wires} wires"


def dxf(folder: Path, rig: ExportedRig) -> tuple[float, str]:
    """By ezdxf, whose audit finds no error: points and texts of dimensions."""
    import ezdxf

    drawing = ezdxf.readfile(str(folder / "rig.dxf"))
    audit = drawing.audit()
    if audit.errors:
        raise ValueError(f"{len(audit.errors)} errors of ezdxf's audit")
    points = drawing.modelspace().query("POINT[layer=='POINTS']")
    read = np.array([(*point.dxf.location,) for point in points])
    names = drawing.modelspace().query("TEXT[layer=='DIMENSIONS']")
    up = int(np.argmax(np.abs(rig.up)))
    first, second = (up + 1) % 3, (up + 2) % 3
    # FRONT is drawn first and where it is: across the first axis, up the last.
    want = [*rig.datums, *(reference_point(device)[1] for device in rig.devices)]
    front = 1e3 * np.array(want)[:, [first, up]]
    off = np.abs(read[: len(want), :2] - front).max()
    told = {text.dxf.text for text in names}
    for device in rig.devices:
        apart = reference_point(device)[1] - rig.datums[0]
        for axis in (first, second, up):
            if f"{device.id} {1e3 * apart[axis] + 0.0:.2f}" not in told:
                raise ValueError(f"{device.id}: a dimension is missing")
    kinds = f"{len(read)} points in three views, {len(names)} dimensions"
    return float(off), kinds


def mounts(folder: Path, rig: ExportedRig) -> tuple[float, str]:
    """By Python's csv: mounts, and distances to the datum points, to 0.01 mm."""
    lines = (folder / "mounts.csv").read_text().splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    worst = 0.0
    for row, device in zip(rows, rig.devices, strict=True):
        place = np.array([float(row[f"{axis}_mm"]) for axis in "xyz"])
        told = np.array([float(row[f"to_D{k}_mm"]) for k in range(1, 5)])
        far = 1e3 * np.linalg.norm(rig.datums - reference_point(device)[1], axis=1)
        off = place - 1e3 * reference_point(device)[1]
        worst = max(worst, float(np.abs(off).max()), float(np.abs(told - far).max()))
    return worst, f"{len(rows)} mounts and their distances, rounded to 0.01 mm"


def _apart(read: Array, want: Array) -> float:
    """Largest distance of a wanted point to the nearest that was read."""
    return float(np.linalg.norm(read[:, None] - want, axis=2).min(axis=0).max())
