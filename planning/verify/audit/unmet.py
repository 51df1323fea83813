"""Which requirements a plan misses by its own claims."""

from planning.model.plan import RigPlan


def unmet_requirements(plan: RigPlan) -> tuple[str, ...]:
    """Return one sentence for each requirement on the target that isn't met.

    lit >= dominant_coverage x reachable by projectors, measured >= coverage x reachable
    by cameras, reachable by projectors >= min_reachable x target, reachable by cameras
    >= min_reachable x lit. Read from the claims, which the audit holds against its own
    figures apart.
    """
    limits, areas = plan.requirements, plan.coverage.target
    by_projectors = ("reachable_by_projectors_m2", areas.reachable_by_projectors_m2)
    by_cameras = ("reachable_by_cameras_m2", areas.reachable_by_cameras_m2)
    lit, measured = ("lit_m2", areas.lit_m2), ("measured_m2", areas.measured_m2)
    whole = ("area_m2", areas.area_m2)
    rules = (
        ("min_reachable", by_projectors, limits.min_reachable, whole),
        ("dominant_coverage", lit, limits.dominant_coverage, by_projectors),
        ("coverage", measured, limits.coverage, by_cameras),
        ("min_reachable", by_cameras, limits.min_reachable, lit),
    )
    return tuple(
        f"requirements.{name}: {part} {area:.6g} m² is less than {share:g} x {of} = "
        f"{share * total:.6g} m²"
        for name, (part, area), share, (of, total) in rules
        if not (total > 0.0 and area >= share * total * (1.0 - 1e-9))
    )
