"""Which requirements a plan misses by its own claims."""

from planning.model.plan import RigPlan

from .ledger import as_number


def unmet_requirements(plan: RigPlan) -> tuple[str, ...]:
    """Return one sentence for each requirement on the target that isn't met.

    lit >= dominant_coverage x reachable by projectors, measured >= coverage x reachable
    by cameras, reachable by projectors >= min_reachable x target, reachable by cameras
    >= min_reachable x lit. Read from the claims, which the audit holds against its own
    figures apart.
    """
    limits = plan.requirements
    target = plan.to_document()["coverage"].get("target")
    areas = target if isinstance(target, dict) else {}
    rules = (
        (
            "min_reachable",
            "reachable_by_projectors_m2",
            limits.min_reachable,
            "area_m2",
        ),
        (
            "dominant_coverage",
            "lit_m2",
            limits.dominant_coverage,
            "reachable_by_projectors_m2",
        ),
        ("coverage", "measured_m2", limits.coverage, "reachable_by_cameras_m2"),
        ("min_reachable", "reachable_by_cameras_m2", limits.min_reachable, "lit_m2"),
    )
    sentences: list[str] = []
    for name, part, share, whole in rules:
        have, of = as_number(areas.get(part)), as_number(areas.get(whole))
        if have is None or of is None:
            continue
        if not (of > 0.0 and have >= share * of * (1.0 - 1e-9)):
            sentences.append(
                f"requirements.{name}: {part} {have:.6g} m² is less than "
                f"{share:g} x {whole} = {share * of:.6g} m²"
            )
    return tuple(sentences)
