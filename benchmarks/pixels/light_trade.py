"""What light costs: lumens and exposure against cameras, coverage and sigma.

The sample on the default rig with a stated light (albedo 0.5, 100 lux of the room, the
preset imx250 at f/11), at most one refresh and at most six. Printed of each plan are
the exposures, grey levels (lit and dark) of the most grazing sample of all projectors,
what is measured of what is lit, what is too dark, the cameras, and sigma of noise alone
with its part by the light.

    python -m benchmarks.pixels.light_trade
"""

from dataclasses import replace

from planning import RequirementError, load_mesh, load_rig, plan_rig
from planning.model.errors import InfeasibleLimitsError
from planning.model.light.photometry_table import PhotometryTable
from planning.model.plan import RigPlan

_LUMENS = (60.0, 250.0)
_EXPOSURES_MS = (17.0, 100.0)


def planned(lumens: float, exposure_ms: float) -> tuple[RigPlan, bool]:
    """Return a plan, and whether it meets every requirement."""
    light = PhotometryTable(
        lumens=lumens,
        albedo=0.5,
        room_lux=100.0,
        max_exposure_ms=exposure_ms,
        quantum_efficiency=0.55,
        full_well_e=10_700.0,
        read_noise_e=2.5,
    )
    rig = load_rig("default")
    rig = replace(rig, table=rig.table.model_copy(update={"photometry": light}))
    mesh = load_mesh("face.obj", unit="mm")
    try:
        return plan_rig(mesh, rig, max_projectors=3, check=False), True
    except RequirementError as missed:
        return missed.plan, False


def row(lumens: float, exposure_ms: float) -> str:
    """Return a line of the table."""
    try:
        plan, met = planned(lumens, exposure_ms)
    except InfeasibleLimitsError:
        return (
            f"| {lumens:g} | {exposure_ms:g} |"
            + " |" * 4
            + " none |"
            + " |" * 2
            + " no |"
        )
    exposures = [p.exposure for p in plan.document.projectors if p.exposure]
    grazing = [e.most_grazing for e in exposures if e.most_grazing]
    lit, dark = min((g.lit[0], g.dark[0]) for g in grazing)
    areas, sigma = plan.coverage.target, plan.coverage.sigma
    too_dark = plan.coverage.uncovered_by_cause.get("too_dark", 0.0)
    noise = terms = 0.0
    if sigma is not None:
        noise, terms = sigma.noise_median_m or 0.0, sigma.terms_rms_m["light"]
    times = "/".join(f"{1e3 * e.exposure_s:.0f}" for e in exposures)
    return (
        f"| {lumens:g} | {exposure_ms:g} | {times} | {lit:.0f} and {dark:.0f} | "
        f"{100.0 * areas.measured_m2 / areas.lit_m2:.1f} % | "
        f"{100.0 * too_dark / areas.area_m2:.1f} % | {len(plan.cameras)} | "
        f"{1e3 * noise:.3f} | {1e3 * terms:.3f} | {'yes' if met else 'no'} |"
    )


def main() -> None:
    """Print the table."""
    print(
        "| lumens | at most [ms] | exposed [ms] | most grazing | measured of lit | "
        "too dark, of the target | cameras | sigma of noise [mm] | rms by light | met |"
    )
    print("|---" * 10 + "|")
    for lumens in _LUMENS:
        for exposure_ms in _EXPOSURES_MS:
            print(row(lumens, exposure_ms), flush=True)


if __name__ == "__main__":
    main()
