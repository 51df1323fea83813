"""The result that a person reads in ten seconds: a verdict, and what follows from it.

At most 25 lines of 100 columns; `plan show` prints the rest, section by section.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from textwrap import wrap

import numpy as np

from geometry.poses import horizontal_axes
from planning.model.plan import RigPlan
from planning.model.words import count_words, share_words, shell_word, tenths
from planning.report.tolerance.joint_lines import joint_words
from planning.report.tolerance.robust_lines import robust_cost
from planning.report.tolerance.survival_lines import by_several_pairs, losses_words

from .cause_words import causes_line
from .check_lines import error_words, missing_words, unchecked
from .count_lines import Block, fewest
from .devices.device_lines import axis_name, devices_words, models_line, standing
from .devices.station_lines import moves_words, title_words
from .family_lines import members_words
from .proof_lines import target_words
from .region_lines import worst_region
from .shortfall import Shortfall, missing
from .summary import lost_in_field
from .warning_lines import warnings

MOST_LINES, COLUMNS = 25, 100
_LABEL = 9
# Lines of a block that a longer text is cut to; devices that are told whatever else is.
_MOST_OF_BLOCK, _FEWEST_DEVICES = 3, 2
_ELSEWHERE = "plan show"
# Stands for a space at which no line is broken; no path holds it.
_UNBROKEN = "\0"


def brief(plan: RigPlan, files: Sequence[str], missed: Sequence[str]) -> str:
    """Return a plan as a person wants it first, in millimetres and degrees.

    Args:
        plan: The plan.
        files: Where it was written.
        missed: What of the requirements it misses, as `shortfalls` and the run say.
    """
    known = {str(one): one for one in missing(plan)}
    short = [known.get(line, Shortfall(line, line)) for line in missed]
    models = models_line(plan.document)
    blocks = [
        *([("MODELS", models, 3)] if models else []),
        *_measured(plan),
        *fewest(plan),
        *_surviving(plan),
        *_robust(plan),
        *_missed(plan, short),
        *_check(plan),
        *_end(plan, files),
    ]
    head = [line for block in _head(plan, short) for line in _block(*block)]
    rest = [line for block in blocks for line in _block(*block)]
    devices = _devices(plan, MOST_LINES - len(head) - len(rest))
    return "\n".join([*head, *devices, *rest])


def _block(label: str, text: str, most: int) -> list[str]:
    """Wrap a text behind its label; what goes beyond `most` lines ends with dots."""
    lines = wrap(text, COLUMNS - _LABEL, break_on_hyphens=False) or [""]
    if len(lines) > most:
        last = wrap(lines[most - 1], COLUMNS - _LABEL - 4, break_on_hyphens=False)[0]
        lines = [*lines[: most - 1], f"{last} ..."]
    lines = [line.replace(_UNBROKEN, " ") for line in lines]
    return [f"{'' if k else label:<{_LABEL}}{line}" for k, line in enumerate(lines)]


def _head(plan: RigPlan, short: Sequence[Shortfall]) -> Iterator[Block]:
    document, rig = plan.document, plan.document.rig
    devices = devices_words(plan)
    if document.stations is not None:
        devices = f"{title_words(document)} ({devices})"
    state = f", {_state(plan)}" if _state(plan) else ""
    name = members_words(plan) or Path(document.own_mesh.path or "the mesh").name
    if short:
        figures = [one.figure for one in short[:2]]
        more = f"; and {len(short) - 2} more" if len(short) > 2 else ""
        verdict = f"{'; '.join(figures)}{more} ({devices} for {name}){state}"
        yield "NOT MET", verdict, 2
    else:
        stand = document.evaluation
        as_built = f", as they stand in {stand.path}" if stand else ""
        yield "OK", f"{devices} measure {name} as asked{as_built}{state}", 2
    x, y, z = np.diff(plan.surface.mesh.bounds, axis=0)[0] * 1e3
    up = axis_name(plan.requirements.workspace.up)
    if plan.members:
        worst = document.members[document.family.worst].name if document.family else ""
        yield "", f"below: {worst}, the worst member", 1
    yield (
        "",
        f"{x:.0f} x {y:.0f} x {z:.0f} mm, up {up}, rig {rig.name}; target: "
        f"{target_words(plan)}",
        2,
    )
    if lost := lost_in_field(plan):
        yield "WARNING", lost, 2
    for line in warnings(plan)[:2]:
        yield "WARNING", line, 1
    if document.assumed:
        yield "ASSUMED", f"{'; '.join(document.assumed)}", 2


def _state(plan: RigPlan) -> str:
    state = unchecked(plan)
    cut = f"TRUNCATED{', NOT CHECKED' * bool(state)}"
    return cut if plan.document.truncated else state


def _devices(plan: RigPlan, room: int) -> list[str]:
    """Return where devices stand and how they are turned, as many as there is room."""
    every, up = list(standing(plan)), np.array(plan.requirements.workspace.up)
    # Below stands what is meant by it.
    told = every if len(every) <= room - 2 else every[: max(room - 3, _FEWEST_DEVICES)]
    lines = [
        "         position x, y, z [mm]             pan    tilt    roll   aim azimuth, "
        "elevation   standoff"
    ]
    for device, numbers in told:
        x, y, z, pan, tilt, roll, azimuth, elevation, distance = tenths(numbers)
        kept = (
            f"  existing: {device.existing}"
            if device.existing not in ("", device.id)
            else ""
        )
        lines.append(
            f"{device.id:<4} {x:9.1f} {y:9.1f} {z:9.1f}  {pan:9.1f} {tilt:7.1f} "
            f"{roll:7.1f}   {azimuth:11.1f} {elevation:11.1f}   {distance:8.1f}"
            f"{f'  {device.station}' if device.station else ''}{kept}"[:COLUMNS]
        )
    if len(told) < len(every):
        lines.append(f"         and {len(every) - len(told)} more: {_ELSEWHERE}")
    first = axis_name(horizontal_axes(up)[0])
    lines.append(
        f"         optical centres in the axes of the mesh; degrees of the housing, "
        f"pan about {axis_name(up)} from {first}"
    )
    return lines


def _measured(plan: RigPlan) -> Iterator[Block]:
    areas, asked = plan.coverage.target, plan.requirements
    sigma, limit = plan.coverage.sigma, asked.triangulation.max_sigma_m
    lit = share_words(
        areas.lit_m2, areas.reachable_by_projectors_m2, asked.dominant_coverage
    )
    seen = share_words(areas.measured_m2, areas.reachable_by_cameras_m2, asked.coverage)
    if several := by_several_pairs(plan):
        seen = f"{seen} by one pair, {several}"
    first = f"lit {lit} ({100 * asked.dominant_coverage:g} asked) and measured"
    if plan.cameras_alone:
        first = f"by pairs, {asked.min_views} cameras or more seeing it, measured"
    text = (
        f"{share_words(areas.measured_m2, areas.area_m2)} of the target; of what can "
        f"be, {first} {seen} ({100 * asked.coverage:g})"
    )
    yield "MEASURED", text, 2
    if sigma is None:
        return
    most = "" if limit is None else f", {1e3 * limit:g} asked"
    if asked.triangulation.calibration is None:
        of = "the rig states no [calibration]"
    else:
        of = f"{1e3 * (sigma.noise_median_m or 0.0):.3f} of noise"
    yield (
        "EXACT",
        f"to {1e3 * sigma.median_m:.3f} mm along the normal (median sigma; 95 % within "
        f"{1e3 * sigma.p95_m:.3f}{most}); {of}",
        2,
    )


def _surviving(plan: RigPlan) -> Iterator[Block]:
    """Say what any one loss leaves and costs, and what planning together saved."""
    for words in (losses_words(plan), joint_words(plan)):
        if words is not None:
            yield *words, 2


def _robust(plan: RigPlan) -> Iterator[Block]:
    """Say how many drawn rigs meet what is asked, and what that took."""
    found = plan.document.robust
    if found is None:
        return
    more = robust_cost(plan, found)
    without = f"; {found.n_met_without} without {' and '.join(more)}" if more else ""
    met = f"{found.n_met} of {found.n_drawn} drawn rigs meet what is asked"
    yield "ROBUST", f"{met}{without} (plan show --all)", 1


def _missed(plan: RigPlan, short: Sequence[Shortfall]) -> Iterator[Block]:
    """What isn't measured, where it is worst, and the one or two things that help."""
    worst, areas = worst_region(plan), plan.coverage.target
    if worst is not None:
        yield "WORST", worst, 2
    if short:
        for label, one in zip(("MISSED", ""), short, strict=False):
            yield label, one.missed, _MOST_OF_BLOCK
        if helps := _helps(short):
            yield "HELPS", "; ".join(helps), _MOST_OF_BLOCK
        return
    if causes := plan.coverage.uncovered_by_cause:
        yield "LEFT OUT", causes_line(causes, areas.area_m2, most=2), 1


def _helps(short: Sequence[Shortfall]) -> list[str]:
    """Return two things that would help, the surest of each shortfall first."""
    firsts = [one.helps[0] for one in short if one.helps]
    every = [*firsts, *(text for one in short for text in one.helps[1:])]
    # The same option with other words is the same help.
    told = {text.split(" (")[0]: text.removeprefix("or ") for text in reversed(every)}
    return [told[key] for key in dict.fromkeys(t.split(" (")[0] for t in every)][:2]


def _check(plan: RigPlan) -> Iterator[Block]:
    check = plan.document.reconstruction
    if check is None:
        return
    rms, p95, bias = check.accuracy_rms_m, check.accuracy_p95_m, check.accuracy_bias_m
    if rms is None or p95 is None or bias is None:
        yield "CHECK", "FAILED: no point was measured in the rendered pixels", 1
        return
    limits, gone = plan.requirements.check, missing_words(check, plan.requirements)
    verdict = "passed" if check.passed else "FAILED"
    yield (
        "CHECK",
        f"{verdict}: {error_words(rms, p95, bias, limits)}, "
        f"{gone} missing ({100 * limits.max_predicted_missing:g})",
        2,
    )
    bounced = check.interreflection
    if bounced and (warning := bounced.warning()):
        yield "WARNING", warning, 2


def _end(plan: RigPlan, files: Sequence[str]) -> Iterator[Block]:
    document, cost = plan.document, plan.document.cost
    if cost.n_frames and not document.evaluation:
        seconds = (
            "" if cost.frame_s is None else f", {cost.n_frames * cost.frame_s:.2f} s"
        )
        yield (
            "SCAN",
            f"{count_words(cost.n_frames, 'frame')}{seconds}{moves_words(document)}",
            1,
        )
    if not files:
        return
    folder = Path(files[0]).parent
    yield "FILES", f"{folder}: {', '.join(Path(one).name for one in files)}", 2
    word = shell_word(folder).replace(" ", _UNBROKEN)
    yield (
        "MORE",
        f"`{_ELSEWHERE} {word} --all`: proofs, regions, rings, cost; `plan verify "
        f"{word}` checks it again",
        2,
    )
