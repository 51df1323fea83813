"""Claims about which projectors fire together, from the overlaps of the same plan."""

from planning.model.plan import RigPlan
from planning.verify.audit.ledger import Ledger, as_number, entries

# Vertices coloured before a claim of exhaustion is taken as it is.
_STEPS = 200_000


def audit_schedule(plan: RigPlan, ledger: Ledger) -> None:
    """Check `firing_schedule`: groups without an overlap, as few as is claimed.

    Every projector fires once; two whose claimed overlap has an area never fire
    together. The groups are the fewest if as many projectors overlap pairwise
    (`clique`), or if no assignment to one group fewer is left (`exhaustion`), which is
    tried here too.
    """
    names = [projector.id for projector in plan.projectors]
    near = _overlapping(ledger, names)
    key, groups = "firing_schedule", ledger.read("firing_schedule", "groups")
    whole = isinstance(groups, list) and all(isinstance(g, list) and g for g in groups)
    listed = [str(name) for group in groups for name in group] if whole else []
    if not ledger.holds(
        whole and sorted(listed) == sorted(names),
        f"{key}.groups",
        f"{groups!r} must name each of {', '.join(names)} exactly once",
    ):
        return
    for group in groups:
        for i, one in enumerate(group):
            for other in group[i + 1 :]:
                ledger.holds(
                    other not in near[one],
                    f"{key}.groups",
                    f"{one} and {other} fire together, but by the plan's own overlaps "
                    f"they light a surface in common",
                )
    stated = ledger.read(key, "n_groups")
    ledger.holds(
        stated == len(groups),
        f"{key}.n_groups",
        f"{stated!r} is claimed for {len(groups)} groups",
    )
    _audit_proof(near, len(groups), ledger)


def _audit_proof(near: dict[str, set[str]], n: int, ledger: Ledger) -> None:
    key, schedule = "firing_schedule", ledger.read("firing_schedule")
    proof, least = schedule.get("proof"), as_number(schedule.get("lower_bound"))
    clique = schedule.get("clique")
    members = [str(m) for m in clique] if isinstance(clique, list) else []
    pairwise = len(set(members)) == len(members) and all(
        b in near.get(a, set()) for a in members for b in members if a != b
    )
    ledger.holds(
        pairwise and all(member in near for member in members),
        f"{key}.clique",
        f"{clique!r} must be projectors that overlap pairwise",
    )
    ledger.holds(
        least is not None and least <= n,
        f"{key}.lower_bound",
        f"{schedule.get('lower_bound')!r} for {n} groups",
    )
    proved = {
        "clique": len(members) == n == least,
        "exhaustion": least == n and not _colourable(near, n - 1),
        "none": least == len(members),
    }
    ledger.holds(
        proved.get(str(proof), False),
        f"{key}.proof",
        f"{proof!r} doesn't prove that {least} groups are needed",
    )


def _overlapping(ledger: Ledger, names: list[str]) -> dict[str, set[str]]:
    near: dict[str, set[str]] = {name: set() for name in names}
    for row in entries(ledger.read("overlaps")):
        pair = row.get("projectors")
        areas = [
            as_number(row.get(part)) or 0.0 for part in ("target_m2", "surface_m2")
        ]
        if isinstance(pair, list) and len(pair) == 2 and max(areas) > 0.0:
            one, other = map(str, pair)
            if one != other and one in near and other in near:
                near[one].add(other)
                near[other].add(one)
    return near


def _colourable(near: dict[str, set[str]], k: int) -> bool:
    """Whether k groups are enough, projectors taken as they come; False in doubt."""
    names, steps = list(near), 0
    group: dict[str, int] = {}

    def place(i: int, used: int) -> bool:
        nonlocal steps
        steps += 1
        if i == len(names) or steps > _STEPS:
            return i == len(names)
        taken = {group[other] for other in near[names[i]] if other in group}
        for g in range(min(used + 1, k)):
            if g not in taken:
                group[names[i]] = g
                if place(i + 1, max(used, g + 1)):
                    return True
                del group[names[i]]
        return False

    return place(0, 0)
