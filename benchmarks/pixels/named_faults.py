"""Which device is named: 100 draws of small faults, over edges simulated exactly.

A device turned by 0.05 degrees or moved by 0.5 mm in any direction, a focal length off
by 0.5 %, two devices swapped, an object 0.2 % larger: in turn, of any device; every
edge with noise, one in fifty labelled wrong. Either nothing else is off, or all devices
are by what a stated calibration leaves of them.

    python -m benchmarks.pixels.named_faults DIR/plan.json [--draws 100]
"""

import argparse
from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from support.simulated_edges import simulated_edges

from planning.model.calibration_errors import CalibrationErrors
from planning.model.plan import RigPlan
from planning.verify.reconstruction.faults.adjustment import expected_of
from planning.verify.reconstruction.faults.bundle import SHIFT, TURN, ZOOM, Bundle
from planning.verify.reconstruction.faults.cause_words import in_words
from planning.verify.reconstruction.faults.diagnosis import diagnose
from planning.verify.reconstruction.faults.supposed import Role, Supposed
from planning.verify.reconstruction.scanner import Scanner

NOISE_PX, OUTLIERS, EDGES = 0.1, 0.02, 240
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


def main() -> None:
    """Print how often each fault is named."""
    parser = argparse.ArgumentParser()
    parser.add_argument("plan")
    parser.add_argument("--draws", type=int, default=100)
    options = parser.parse_args()
    plan = Scanner.of(RigPlan.load(options.plan))
    print("| the rest | fault | draws | named right | the device, not what it did |")
    print("|---|---|---|---|---|")
    for rest, errors in (("as planned", None), ("as calibrated", CALIBRATED)):
        scanner = replace(plan, calibration=errors)
        bundle = Bundle(
            simulated_edges(Supposed.of(scanner), noise_px=NOISE_PX, most=1),
            Supposed.of(scanner),
        )
        leaves = expected_of(bundle, errors or CalibrationErrors(), (0.0, 0.0, 0.0))
        draws, right, device = Counter(), Counter(), Counter()
        wrong: list[str] = []
        for k in range(options.draws):
            rng = np.random.default_rng(k)
            fault, x = drawn(KINDS[k % len(KINDS)], bundle, rng)
            x = x + leaves * rng.normal(size=len(x))
            edges = simulated_edges(
                bundle.supposed,
                standing(bundle, fault, x),
                noise_px=NOISE_PX,
                outliers=OUTLIERS,
                most=EDGES,
                seed=k,
            )
            causes = diagnose(scanner, edges).causes
            draws[fault.kind] += 1
            first = causes[0][0].change if causes else None
            same = first is not None and (first.role, first.devices) == (
                fault.role,
                fault.devices,
            )
            moves = {"object": ("zoom",)}.get(fault.kind, (fault.kind,))
            if same and len(causes) == len(causes[0]) == 1 and first.moves == moves:
                right[fault.kind] += 1
            else:
                device[fault.kind] += same
                said = "; ".join(in_words(cause, scanner) for cause in causes)
                wrong.append(f"draw {k}, {fault}: {said or 'nothing'}")
        for kind in KINDS:
            print(
                f"| {rest} | {kind} | {draws[kind]} | {right[kind]} | {device[kind]} |"
            )
        print(
            f"| {rest} | all | {draws.total()} | {right.total()} | {device.total()} |"
        )
        print("\n".join(f"<!-- {line} -->" for line in wrong), flush=True)


if __name__ == "__main__":
    main()
