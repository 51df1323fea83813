"""Which device is named, and what refining is worth: small faults, drawn at random.

A device turned by 0.05 degrees or moved by 0.5 mm in any direction, a focal length off
by 0.5 %, two devices swapped, an object 0.2 % larger or smaller, in turn, any device.
First over edges simulated exactly, each with noise, one in fifty labelled wrong.
Nothing else is off and the rig states no calibration, or all devices are off by what a
stated one leaves of them. Rigs without a fault are drawn, too. Then through rendered
pixels, what the plan's own calibration leaves being expected, the rig refined before
the cloud is merged, against the object as it stands.

    python -m benchmarks.pixels.named_faults DIR/plan.json [--draws 100] [--rendered 10]
"""

import argparse
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from support.simulated_edges import simulated_edges

from geometry.mesh.mesh import TriangleMesh
from geometry.rays.proximity import closest_points
from planning.model.devices.calibration_errors import CalibrationErrors
from planning.model.plan import RigPlan
from planning.verify.audit.coverage.prediction import predict_measured
from planning.verify.reconstruction.captures.captured import reconstruct_rendered
from planning.verify.reconstruction.check.accuracy import Expected
from planning.verify.reconstruction.check.deviation import best_fit
from planning.verify.reconstruction.faults.adjustment import expected_of
from planning.verify.reconstruction.faults.bundle import SHIFT, TURN, ZOOM, Bundle
from planning.verify.reconstruction.faults.cause_words import in_words
from planning.verify.reconstruction.faults.diagnosis import diagnose
from planning.verify.reconstruction.faults.explanations import Change
from planning.verify.reconstruction.faults.supposed import Role, Supposed
from planning.verify.reconstruction.scanner import Scanner
from planning.verify.verification import bare

NOISE_PX, OUTLIERS, EDGES = 0.1, 0.02, 400
TURNED, MOVED_M, LONGER, LARGER = np.deg2rad(0.05), 5e-4, 5e-3, 2e-3
# What a good calibration leaves of each device.
CALIBRATED = CalibrationErrors(np.deg2rad(0.005), 5e-5, 5e-4)
KINDS = ("turn", "shift", "zoom", "swap", "object")


@dataclass(frozen=True)
class Fault:
    """What is planted."""

    kind: str
    role: Role
    devices: tuple[int, ...]


def drawn(
    kind: str, bundle: Bundle, rng: np.random.Generator
) -> tuple[Fault, NDArray[np.float64]]:
    """Return a fault of a kind, of any device, and the changes that it makes."""
    rig, x = bundle.supposed, np.zeros(bundle.n_unknowns)
    if kind == "none":
        return Fault(kind, "objects", (0,)), x
    sizes: dict[Role, int] = {
        "cameras": len(rig.cameras),
        "projectors": len(rig.projectors),
    }
    if kind == "object":
        x[bundle.columns("objects", 0, ZOOM)] = rng.choice([-1.0, 1.0]) * LARGER
        return Fault(kind, "objects", (0,)), x
    if kind == "swap":
        role = rng.choice([role for role, size in sizes.items() if size > 1])
        two = sorted(rng.permutation(sizes[role])[:2].tolist())
        return Fault(kind, role, tuple(two)), x
    every = [(role, k) for role, size in sizes.items() for k in range(size)]
    role, index = every[int(rng.integers(len(every)))]
    towards = rng.normal(size=3)
    towards /= np.linalg.norm(towards)
    part, change = {
        "turn": (TURN, TURNED * towards),
        "shift": (SHIFT, MOVED_M * towards),
        "zoom": (ZOOM, rng.choice([-1.0, 1.0]) * LONGER),
    }[kind]
    x[bundle.columns(role, index, part)] = change
    return Fault(kind, role, (index,)), x


def standing(bundle: Bundle, fault: Fault, x: NDArray[np.float64]) -> Supposed:
    """Return how everything stands with a fault."""
    stands = bundle.moved(x)
    if fault.kind != "swap":
        return stands
    devices = list(getattr(stands, fault.role))
    one, other = fault.devices
    devices[one], devices[other] = devices[other], devices[one]
    return replace(stands, **{fault.role: tuple(devices)})


def by_edges(plan: Scanner, n_draws: int) -> None:
    """Print how often each fault is named."""
    print("| the rest | fault | draws | named first | nothing as good | said nothing |")
    print("|---|---|---|---|---|---|")
    for rest, errors in (("as planned", None), ("as calibrated", CALIBRATED)):
        scanner = replace(plan, calibration=errors)
        rig = Supposed.of(scanner)
        bundle = Bundle(simulated_edges(rig, noise_px=NOISE_PX, most=1), rig)
        leaves = expected_of(bundle, errors or CalibrationErrors())
        leaves[bundle.columns("objects", 0)] = 0.0
        draws, first, alone, silent = Counter(), Counter(), Counter(), Counter()
        remarks: list[str] = []
        kinds = [KINDS[k % len(KINDS)] for k in range(n_draws)]
        for k, kind in enumerate([*kinds, *["none"] * (n_draws // 5)]):
            rng = np.random.default_rng(k)
            fault, x = drawn(kind, bundle, rng)
            x = x + leaves * rng.normal(size=len(x))
            edges = simulated_edges(
                rig,
                standing(bundle, fault, x),
                noise_px=NOISE_PX,
                outliers=OUTLIERS,
                most=EDGES,
                seed=k,
            )
            causes = diagnose(scanner, edges).causes
            changes = [each.change for each in causes[0]] if causes else []
            moves = {"object": ("zoom",)}.get(kind, (kind,))
            right = Change(fault.role, fault.devices, moves)
            draws[kind] += 1
            silent[kind] += not causes
            first[kind] += changes[:1] == [right] and len(causes) == 1
            alone[kind] += changes == [right] and len(causes) == 1
            if changes != [right] and (causes or kind != "none"):
                said = "; ".join(in_words(cause, scanner) for cause in causes)
                remarks.append(f"{rest}, draw {k}, {fault}: {said or 'nothing'}")
        counts = (draws, first, alone, silent)
        for kind in (*KINDS, "none"):
            row = " | ".join(str(each[kind]) for each in counts)
            print(f"| {rest} | {kind} | {row} |")
        row = " | ".join(str(each.total() - each["none"]) for each in counts)
        print(f"| {rest} | all faults | {row} |")
        print("\n".join(f"<!-- {line} -->" for line in remarks), flush=True)


def by_pixels(plan: Scanner, path: str, n_draws: int) -> None:
    """Print errors of refined clouds against the object as it stands."""
    predicted = predict_measured(RigPlan.load(path), seed=0, threads=2)
    expected = Expected(bare(predicted.samples), predicted.measured, predicted.by_pair)
    rig = Supposed.of(plan)
    bundle = Bundle(simulated_edges(rig, noise_px=NOISE_PX, most=1), rig)
    print("\n| fault | mended | points | rms [mm] | best fit [mm] | what is said |")
    print("|---|---|---|---|---|---|")
    for k in range(-1, n_draws):
        kind = "none" if k < 0 else KINDS[k % len(KINDS)]
        fault, x = drawn(kind, bundle, np.random.default_rng(k + 1000))
        truth = as_scanner(plan, standing(bundle, fault, x))
        for mend in (False, True) if k < 0 else (True,):
            found = reconstruct_rendered(
                plan, expected, seed=max(k, 0), truth=truth, mend=mend
            )
            cloud = found.merged.cloud.points
            pose = best_fit(truth.mesh, cloud, plan.limits.check.max_rms_m)
            fitted = cloud @ pose[:3, :3].T + pose[:3, 3]
            rms = [
                1e3 * np.sqrt(np.mean(closest_points(truth.mesh, one).distances ** 2))
                for one in (cloud, fitted)
            ]
            said = "" if found.refined is None else "; ".join(found.refined.named)
            what = f"{kind} of {fault.role} {fault.devices}" if k >= 0 else "none"
            print(
                f"| {what} | {'yes' if mend else 'no'} | {found.n_merged} | "
                f"{rms[0]:.4f} | {rms[1]:.4f} | {said} |",
                flush=True,
            )


def as_scanner(plan: Scanner, stands: Supposed) -> Scanner:
    """Return what stands there; devices keep the names of their places."""
    (body,) = stands.objects
    turn, mesh = body.world_from_device[:3, :3], plan.mesh
    moved = body.centre + body.scale * (mesh.vertices - mesh.centre) @ turn.T
    return replace(
        plan,
        cameras=tuple(
            replace(now, id=one.id)
            for one, now in zip(plan.cameras, stands.cameras, strict=True)
        ),
        projectors=tuple(
            replace(now, id=one.id)
            for one, now in zip(plan.projectors, stands.projectors, strict=True)
        ),
        mesh=TriangleMesh(moved, mesh.faces),
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("plan")
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--rendered", type=int, default=10)
    options = parser.parse_args()
    plan = Scanner.of(RigPlan.load(options.plan))
    if options.draws:
        by_edges(plan, options.draws)
    by_pixels(plan, options.plan, options.rendered)


if __name__ == "__main__":
    main()
