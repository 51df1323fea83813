"""Faults planted in the sample's rig: does the check fail, and name the right cause?

Each fault changes what really stands there (`plan verify --truth`) or what the plan
says, the claims being those of the sound plan. Then the sound plan is checked with 20
seeds of the audit's samples and the pixels' noise, all of which must pass.

    python -m benchmarks.pixels.planted_faults [face-plan/plan.json]

Without a plan the sample is planned first.
"""

import re
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from support.reconstruction_rigs import reconstruct_plan

from benchmarks.pixels.seam_gap import GAP, predicted_limit, seam_samples, wall_rig
from geometry.mesh.mesh import TriangleMesh
from geometry.mesh.sampling import SurfaceSamples
from planning import load_mesh, load_rig, plan_rig
from planning.cli.other_commands import write_sample
from planning.model.plan import RigPlan
from planning.verify.audit.audit import audit_plan
from planning.verify.verification import bare, verify_plan

SEEDS = 20
# Incidence that a grazing projector is turned to [rad].
_GRAZING = np.deg2rad(78.0)
Document = dict[str, Any]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Claims:
    """Samples of the target and which of them the sound plan claims measured."""

    samples: SurfaceSamples
    predicted: NDArray[np.bool_]

    @classmethod
    def of(cls, plan: RigPlan, seed: int = 0) -> "Claims":
        """Audit a plan."""
        case = audit_plan(plan, seed=seed).case
        return cls(bare(case.samples), case.actual.measured)


@dataclass(frozen=True, eq=False)
class Fault:
    """What is planted, and what the check must say of it.

    Attributes:
        name: In words.
        plan: What the decoder believes.
        truth: What really stands there.
        cause: Regular expression that a failure must match.
        claims: What is claimed measured; None: what the sound plan claims.
        audited: Whether the audit of the plan's own claims must find it.
    """

    name: str
    plan: RigPlan
    truth: RigPlan
    cause: str
    claims: Claims | None = None
    audited: bool = False


def faults(plan: RigPlan) -> list[Fault]:
    """Return the planted faults of a plan with two devices or more of each kind."""
    first, second = (projector.id for projector in plan.projectors[:2])
    one, two = (camera.id for camera in plan.cameras[:2])
    grazing = changed(plan, lambda d: _turn_to_grazing(d, plan, 1))
    mesh = plan.surface.mesh
    larger = TriangleMesh(1.01 * mesh.vertices, mesh.faces)
    truths = [
        (
            "a projector at 78 degrees",
            grazing,
            rf"{second} looks .* at 7\d degrees \(median\): grazing",
        ),
        (
            "a beam aimed 50 mm off",
            changed(plan, lambda d: _aim_aside(d, 1, 0.05)),
            rf"{second} looks as if it were turned by at least .* \(aimed (49|5\d) mm",
        ),
        (
            "a projector off",
            changed(plan, lambda d: d["projectors"].pop(1)),
            f"{second} is dark",
        ),
        (
            "a camera off",
            changed(plan, lambda d: d["cameras"].pop(1)),
            f"{two} is dark",
        ),
        (
            "two cameras swapped",
            changed(plan, lambda d: _swap(d["cameras"])),
            f"{one} and {two} look swapped",
        ),
        (
            "two projectors swapped",
            changed(plan, lambda d: _swap(d["projectors"])),
            f"{first} and {second} look swapped",
        ),
        (
            "a camera's focal length 2 % longer",
            changed(plan, lambda d: _zoom(d["cameras"][1], 1.02)),
            f"{two} looks as if its focal length were 2 % longer",
        ),
        (
            "a projector's focal length 2 % shorter",
            changed(plan, lambda d: _zoom(d["projectors"][0], 0.98)),
            f"{first} looks as if its focal length were 2 % shorter",
        ),
        (
            "a camera moved by 2 mm",
            changed(plan, lambda d: _move(d["cameras"][0], [2e-3, 0.0, 0.0])),
            rf"{one} looks as if it stood (2|1\.99|2\.0\d) mm from its place",
        ),
        (
            "a camera moved, another's focal length 2 % longer",
            changed(plan, _two_faults),
            f"{two} looks as if its focal length were 2 % longer",
        ),
        (
            "the object 1 % larger than the mesh",
            replaced(plan, larger),
            "the object looks 1 % larger",
        ),
        (
            "two projectors on at the same time",
            changed(plan, lambda d: _fire_together(d, first, second)),
            f"{second} lights them too, on at the same time",
        ),
    ]
    planted = [Fault(name, plan, truth, cause) for name, truth, cause in truths]
    planned = changed(plan, lambda d: _turn_to_grazing(d, plan, 1))
    axis = changed(plan, lambda d: _ring_axis_through(d, 1, mesh))
    planted.append(
        Fault(
            "a plan whose projector stands at 78 degrees",
            planned,
            planned,
            "uncovered_by_cause.projector_incidence: claimed",
            audited=True,
        )
    )
    planted.append(
        Fault(
            "a plan whose ring axis runs through the middle of the face",
            axis,
            axis,
            "`conditioning`, the rays run along the rings' cones",
        )
    )
    planted.append(_too_wide())
    return planted


def check(fault: Fault, claims: Claims) -> tuple[str, ...]:
    """Return the failures of the check with a fault."""
    asked = fault.claims or claims
    found = reconstruct_plan(
        fault.plan,
        seed=0,
        truth=fault.truth,
        samples=asked.samples,
        predicted=asked.predicted,
    )
    if not fault.audited:
        return found.failures
    return audit_plan(fault.plan, seed=0).failures + found.failures


def changed(plan: RigPlan, change: Callable[[Document], object]) -> RigPlan:
    """Return a plan with its document changed."""
    document = plan.to_document()
    change(document)
    return RigPlan.from_document(document, plan.surface)


def replaced(plan: RigPlan, mesh: TriangleMesh) -> RigPlan:
    """Return a plan's devices about another mesh of the same faces."""
    from dataclasses import replace

    return RigPlan.from_document(plan.to_document(), replace(plan.surface, mesh=mesh))


def _too_wide() -> Fault:
    """Two cameras over a wall, 2 mm farther apart than eq. (10) allows."""
    plan = wall_rig(predicted_limit() + 2e-3)
    samples, every = seam_samples()
    cause = "lie between what C1 and C2 measured, a hole about 2"
    return Fault(
        f"a baseline 2 mm too wide (f = 8000, rings {1e3 * GAP:g} mm apart)",
        plan,
        plan,
        cause,
        Claims(samples, every),
    )


def _turned(entry: Document, turn: Matrix, about: Matrix) -> None:
    for key in ("world_from_device", "world_from_ring"):
        if key in entry:
            pose = np.array(entry[key])
            pose[:3, :3] = turn @ pose[:3, :3]
            pose[:3, 3] = about + turn @ (pose[:3, 3] - about)
            entry[key] = pose.tolist()


def _turn_to_grazing(document: Document, plan: RigPlan, index: int) -> None:
    """Carry a projector about the object until what faces it is lit at 78 degrees."""
    mesh, entry = plan.surface.mesh, document["projectors"][index]
    pose = np.array(entry["world_from_device"])
    cosine = -mesh.face_normals @ pose[:3, 2]
    others = [-mesh.face_normals @ p.world_from_device[:3, 2] for p in plan.projectors]
    faced = plan.surface.in_dominant & (cosine >= np.max(others, axis=0))
    faced &= cosine > 0.5
    up = np.array(document["requirements"]["workspace"]["up"])
    for degrees in np.arange(20.0, 100.0, 2.0):
        for side in (degrees, -degrees):
            turn = Rotation.from_rotvec(np.deg2rad(side) * up).as_matrix()
            lit = -mesh.face_normals[faced] @ (turn @ pose[:3, 2])
            if float(np.median(np.arccos(np.clip(lit, -1.0, 1.0)))) >= _GRAZING:
                _turned(entry, turn, mesh.centre)
                return


def _aim_aside(document: Document, index: int, metres: float) -> None:
    entry = document["projectors"][index]
    pose = np.array(entry["world_from_device"])
    centre = np.array(document["requirements"]["workspace"]["centre"])
    away = float(np.linalg.norm(centre - pose[:3, 3]))
    # Square to the rings' axis: a turn about that leaves no trace in any ring.
    axis = np.cross(pose[:3, 2], np.array(entry["world_from_ring"])[:3, 2])
    axis /= np.linalg.norm(axis)
    turn = Rotation.from_rotvec(np.arctan(metres / away) * axis).as_matrix()
    _turned(entry, turn, pose[:3, 3])


def _swap(devices: list[Document]) -> None:
    devices[0]["id"], devices[1]["id"] = devices[1]["id"], devices[0]["id"]


def _zoom(entry: Document, factor: float) -> None:
    entry["K"][0][0] *= factor
    entry["K"][1][1] *= factor


def _move(entry: Document, by: list[float]) -> None:
    for axis, step in enumerate(by):
        entry["world_from_device"][axis][3] += step


def _two_faults(document: Document) -> None:
    _move(document["cameras"][0], [0.0, 0.0, 2e-3])
    _zoom(document["cameras"][1], 1.02)


def _fire_together(document: Document, first: str, second: str) -> None:
    document["firing_schedule"]["groups"] = [[first, second]]


def _ring_axis_through(document: Document, index: int, mesh: TriangleMesh) -> None:
    """Put the rings' axis through the middle of the object."""
    entry = document["projectors"][index]
    ring = np.array(entry["world_from_ring"])
    towards = mesh.centre - np.array(entry["world_from_device"])[:3, 3]
    towards /= np.linalg.norm(towards)
    axis = np.cross(ring[:3, 2], towards)
    turn = Rotation.from_rotvec(
        axis / np.linalg.norm(axis) * np.arcsin(np.linalg.norm(axis))
    )
    ring[:3, :3] = turn.as_matrix() @ ring[:3, :3]
    entry["world_from_ring"] = ring.tolist()


def sample_plan() -> RigPlan:
    """Plan the sample as the README does."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "face.obj"
        write_sample(path)
        mesh = load_mesh(path, unit="mm")
    return plan_rig(mesh, load_rig("default"), max_projectors=3, seed=0)


def main() -> None:
    """Print both tables."""
    plan = RigPlan.load(sys.argv[1]) if len(sys.argv) > 1 else sample_plan()
    claims = Claims.of(plan)
    print("| planted | check | named | what it says |")
    print("|---|---|---|---|")
    for fault in faults(plan):
        failures = check(fault, claims)
        named = [text for text in failures if re.search(fault.cause, text)]
        right, said = bool(named), (named or failures or ("",))[0]
        print(
            f"| {fault.name} | {'failed' if failures else 'PASSED'} | "
            f"{'yes' if right else 'NO'} | {said} |",
            flush=True,
        )
    passed = 0
    for seed in range(SEEDS):
        found = verify_plan(plan, seed=seed)
        passed += found.passed and found.reconstruction.passed
        for sentence in found.failures:
            print(f"seed {seed}: {sentence}")
    print(f"\nthe sound plan passes {passed} of {SEEDS} seeds")


if __name__ == "__main__":
    main()
