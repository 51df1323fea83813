"""Which single limit, relaxed by how little, would bring how much within reach.

Each limit in turn is lifted while all others stay. For every sample that nothing
reaches, the reference pose that asks least of the lifted limit says what that sample
needs; sorted, these say how far the limit must give way for the required share.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.devices import ParallelModel, PinholeModel
from geometry.poses import inverse, transform
from planning.model.planned import PlannedProjector
from planning.model.requirements import ProjectorLimits
from planning.projectors.candidate_set import NothingLitError
from planning.scene import lighting
from planning.scene.limits.projector_limits import LIT
from planning.scene.samples import Target
from planning.scene.scene import Scene
from planning.scene.workspace.candidates import projector_candidates

_SAMPLES = 800
# Of the rows, where nothing at all is lit.
_DARK_ROWS = 400
_STREAM = 950
# Beyond this no light is worth a relaxation, and an image no wider than three times.
_STEEPEST = float(np.radians(85.0))
_WIDER = 3
_GAIN = 0.01


@dataclass(frozen=True, eq=False)
class LiftedLimit:
    """One limit out of force.

    Attributes:
        say: The limit with a value, as a rig file names it.
        projector: A projector without the limit.
        limits: Limits without it.
        asks: What a projector asks of the limit at each sample, in the unit of `say`.
    """

    say: Callable[[float], str]
    projector: Callable[[PlannedProjector], PlannedProjector]
    limits: ProjectorLimits
    asks: Callable[[PlannedProjector, Target], NDArray[np.float64]]


def reachability_relaxations(
    scene: Scene,
    reference: Sequence[PlannedProjector],
    ring_offset: tuple[float, float],
) -> list[dict[str, Any]]:
    """Return the share of the target that each single relaxation would make reachable.

    Args:
        scene: Surface and requirements.
        reference: The projectors' reference set.
        ring_offset: Tilt and azimuth of its ring axes.

    Returns:
        One entry for each relaxation that gains at least a percentage point, the
        smallest gain first: `change`, `reachable_share`. A limit gives way as far as
        `min_reachable` needs, or else as far as it helps.
    """
    target = scene.target_samples(_SAMPLES, _STREAM)
    left = _unreached(scene, reference, target)
    base = 1.0 - len(left) / len(target)
    wanted = int(np.ceil(scene.requirements.min_reachable * len(target) - 1e-9))
    found = least_relaxations(
        scene, reference, target.take(left), wanted - len(target) + len(left)
    )
    shares = {change: base + gained / len(target) for change, gained in found.items()}
    workspace = scene.requirements.workspace
    whole = workspace.whole_shell
    if whole != workspace:
        site = scene.site("projector", reference[0].device)
        anywhere = projector_candidates(
            reference[0],
            whole,
            len(reference) if site is None else workspace.n_reference_projectors,
            ring_offset=ring_offset,
            site=None if site is None else replace(site, workspace=whole),
        )
        rest = _unreached(scene, anywhere, target)
        shares["the whole shell as workspace"] = 1.0 - len(rest) / len(target)
    gains = [
        {"change": change, "reachable_share": share}
        for change, share in shares.items()
        if share >= base + _GAIN
    ]
    return sorted(gains, key=lambda entry: entry["reachable_share"])


def nothing_lit(scene: Scene, error: NothingLitError) -> str:
    """Say the least by which a single limit must give way for any light at all.

    Args:
        scene: Surface and requirements.
        error: What was offered, and which limits forbid it.
    """
    offered = error.candidates
    dark = offered.samples.take(np.arange(min(len(offered.samples), _DARK_ROWS)))
    helps = list(least_relaxations(scene, offered.projectors, dark, 1))
    if helps:
        return f"the least that lights any of it: {'; or '.join(helps)}"
    return (
        "no single limit of the projector, relaxed, lights any of it: look at the "
        "workspace and at the target"
    )


def least_relaxations(
    scene: Scene, projectors: Sequence[PlannedProjector], dark: Target, wanted: int
) -> dict[str, int]:
    """Return how far each limit alone must give way, and how many samples that gains.

    Args:
        scene: Surface and requirements.
        projectors: Poses.
        dark: Samples that none of them lights.
        wanted: Samples to gain; where fewer can be, all that can.
    """
    found: dict[str, int] = {}
    for lifted in _limits(scene, projectors[0]):
        least = np.full(len(dark), np.inf)
        for projector in projectors:
            scene.check_cancelled()
            stage = lighting.first_failure(
                lifted.projector(projector),
                dark,
                lifted.limits,
                scene.visibility,
                bodies=scene.standing,
            )
            lit = stage == LIT
            asked = lifted.asks(projector, dark.take(lit))
            least[lit] = np.minimum(least[lit], asked)
        helped = np.sort(least[np.isfinite(least)])
        if helped.size and wanted > 0:
            # Up to a whole degree or millimetre: what people write.
            value = float(np.ceil(helped[min(wanted, helped.size) - 1] + 1e-6))
            found[lifted.say(value)] = int((least <= value).sum())
    return found


def _limits(scene: Scene, template: PlannedProjector) -> tuple[LiftedLimit, ...]:
    limits, device = scene.requirements.projector, template.device
    near, far = (1e3 * edge for edge in device.range_m)
    now = np.degrees([limits.max_incidence, limits.min_tangent_angle])

    def same(projector: PlannedProjector) -> PlannedProjector:
        return projector

    def incidence(projector: PlannedProjector, target: Target) -> NDArray[np.float64]:
        facing = lighting.light_on(projector, target).incidence_cos
        return np.degrees(np.arccos(np.clip(facing, -1.0, 1.0)))

    def along_steep(projector: PlannedProjector, target: Target) -> NDArray[np.float64]:
        along = lighting.light_on(projector, target).tangent_cos
        # The more the limit gives way, the larger.
        return -np.degrees(np.arccos(np.clip(along, 0.0, 1.0)))

    def nearer(projector: PlannedProjector, target: Target) -> NDArray[np.float64]:
        away = 1e3 * lighting.light_on(projector, target).distances
        return np.where(away <= far, -away, np.inf)

    def farther(projector: PlannedProjector, target: Target) -> NDArray[np.float64]:
        away = 1e3 * lighting.light_on(projector, target).distances
        return np.where(away >= near, away, np.inf)

    return (
        LiftedLimit(
            lambda value: (
                f"limits.projector_max_incidence_deg = {value:.0f} (now {now[0]:g})"
            ),
            same,
            replace(limits, max_incidence=max(limits.max_incidence, _STEEPEST)),
            incidence,
        ),
        LiftedLimit(
            lambda value: (
                f"limits.min_tangent_angle_deg = {-value:.0f} (now {now[1]:g})"
            ),
            same,
            replace(limits, min_tangent_angle=0.0),
            along_steep,
        ),
        LiftedLimit(
            lambda value: f"a projector sharp from {-value:.0f} mm (now {near:.0f})",
            lambda p: replace(
                p, device=replace(p.device, range_m=(0.0, p.device.range_m[1]))
            ),
            limits,
            nearer,
        ),
        LiftedLimit(
            lambda value: f"a projector sharp to {value:.0f} mm (now {far:.0f})",
            lambda p: replace(
                p, device=replace(p.device, range_m=(p.device.range_m[0], np.inf))
            ),
            limits,
            farther,
        ),
        field_limit(scene, template),
    )


def field_limit(scene: Scene, template: PlannedProjector) -> LiftedLimit:
    """Return the field of projectors, image or beam, out of force."""
    parallel = isinstance(template.device, ParallelModel)
    return LiftedLimit(
        lambda value: (
            f"a beam of {value:.0f} mm about its axis"
            if parallel
            else f"an image that reaches {value:.0f} degrees off its middle on every "
            f"side"
        ),
        widened,
        scene.requirements.projector,
        _off_axis,
    )


def widened(projector: PlannedProjector, times: int = _WIDER) -> PlannedProjector:
    """Return a projector of a wider image or beam, and rings all over it.

    Args:
        projector: Its pose stays.
        times: As many as the image or panel is wide and high.
    """
    device, radii = projector.device, projector.ring_radii
    width, height = device.resolution
    size = (times * width, times * height)
    if isinstance(device, PinholeModel):
        aside = 0.5 * (times - 1) * np.array([width, height])
        k = device.camera_matrix.copy()
        k[:2, 2] += aside
        wide: PinholeModel | ParallelModel = replace(
            device, camera_matrix=k, resolution=size
        )
    else:
        wide = replace(device, resolution=size, beam_radius=None)
    return replace(projector, device=wide, ring_radii=np.append(radii, 1e3))


def _off_axis(projector: PlannedProjector, target: Target) -> NDArray[np.float64]:
    """Return how far samples are off the middle: degrees, or in parallel light mm."""
    device = projector.device
    local = transform(inverse(projector.world_from_device), target.samples.points)
    if isinstance(device, ParallelModel):
        return 1e3 * np.hypot(local[:, 0], local[:, 1])
    middle = device.rays(0.5 * (np.array(device.resolution) - 1.0))
    along = local @ middle / np.linalg.norm(local, axis=1)
    return np.degrees(np.arccos(np.clip(along, -1.0, 1.0)))


def _unreached(
    scene: Scene, reference: Sequence[PlannedProjector], target: Target
) -> NDArray[np.int64]:
    """Return which samples no projector lights."""
    limits = scene.requirements.projector
    left = np.arange(len(target))
    for projector in reference:
        if not len(left):
            break
        stage = lighting.first_failure(
            projector,
            target.take(left),
            limits,
            scene.visibility,
            bodies=scene.standing,
        )
        left = left[stage != LIT]
    return left
