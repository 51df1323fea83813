"""What a plan may claim of each dominant region, on samples enough for its share."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planning.model.document.coverage_records import RegionCoverage
from planning.scene.draws import DRAWS
from planning.scene.lighting import assigned_projectors, lit_margins
from planning.scene.limits.projector_limits import LIT
from planning.scene.samples import Target, merged
from planning.scene.scene import Scene

from .judged import Devices, Judged, by_cause

_Mask = NDArray[np.bool_]
# Equal up to rounding is enough.
_SLACK = 1e-9


@dataclass(frozen=True, eq=False)
class RegionClaim:
    """What a plan does for a region: who is primary to samples of it, and areas."""

    lit_by: tuple[str, ...]
    lit_fraction: float
    coverage: RegionCoverage


@dataclass(frozen=True, eq=False)
class RegionSamples:
    """Samples of the target, and more of large regions that got few; n in all.

    Shares of a region are those of its samples; what each stands for differs.

    Attributes:
        scene: What they lie on.
        target: Where.
        region: Region of each, -1 for none, shape (n,).
        lit, measured, by_projectors, by_cameras: As in `Judged`, shape (n,).
        causes: By which limit each isn't measured, "" where it is, shape (n,).
        primary: Index of the projector that each is assigned to, -1 for none, (n,).
        measured_by: Which camera measures each, shape (n, n_cameras).
    """

    scene: Scene
    target: Target
    region: NDArray[np.int64]
    lit: _Mask
    measured: _Mask
    by_projectors: _Mask
    by_cameras: _Mask
    causes: NDArray[np.str_]
    primary: NDArray[np.int64]
    measured_by: _Mask

    @classmethod
    def of(
        cls,
        scene: Scene,
        devices: Devices,
        judged: Judged,
        margins: NDArray[np.float64],
    ) -> "RegionSamples":
        """Return judged samples of the target, and what large regions lack.

        The margins of the former are (n, n_projectors) [rad].
        """
        parts, every = [judged], [margins]
        more = scene.more_of_regions(judged.target, DRAWS.region_claims)
        if more is not None:
            parts.append(Judged.of(scene, devices, more))
            every.append(lit_margins(scene, devices.projectors, more))
        target = (
            parts[0].target if len(parts) == 1 else merged(*(p.target for p in parts))
        )
        first = np.concatenate([part.first for part in parts])

        def of_all(name: str) -> _Mask:
            return np.concatenate([getattr(part, name) for part in parts])

        return cls(
            scene,
            target,
            scene.region[target.samples.faces],
            of_all("lit"),
            of_all("measured"),
            of_all("by_projectors"),
            of_all("by_cameras"),
            np.concatenate([part.causes(scene, devices) for part in parts]),
            assigned_projectors(first == LIT, np.concatenate(every)),
            of_all("measured_by"),
        )

    def worst(self, lit: _Mask) -> tuple[int, float] | None:
        """Return the large region of least lit / reachable, and that share.

        The first of equals, of those of which anything is lit or reachable by the plan;
        None: there are none. `lit` says which samples are, shape (n,).
        """
        shares: dict[int, float] = {}
        for index in self.scene.large_regions.tolist():
            inside = self.region == index
            if n := int((self.by_projectors | lit)[inside].sum()):
                shares[index] = int(lit[inside].sum()) / n
        return min(shares.items(), key=lambda pair: pair[1], default=None)


def claim_regions(devices: Devices, samples: RegionSamples) -> tuple[RegionClaim, ...]:
    """Return the claims of all regions, in their order."""
    scene = samples.scene
    large, floor = scene.large_regions, scene.requirements.region_coverage
    claims: list[RegionClaim] = []
    for index in range(int(scene.region.max()) + 1):
        areas = _areas(samples, index, [camera.id for camera in devices.cameras])
        if floor and index in large:
            missed = any(below_floor(areas, floor))
            areas = areas.changed(floor="missed" if missed else "met")
        inside = samples.region == index
        by = np.unique(samples.primary[inside])
        names = tuple(devices.projectors[p].id for p in by if p >= 0)
        lit = samples.lit[inside]
        share = float(lit.mean()) if len(lit) else 0.0
        claims.append(RegionClaim(names, share, areas))
    return tuple(claims)


def _areas(
    samples: RegionSamples, index: int, cameras: Sequence[str]
) -> RegionCoverage:
    mesh, inside = samples.scene.mesh, samples.region == index
    n = int(inside.sum())
    area = float(mesh.face_areas[samples.scene.region == index].sum())
    by_projectors, lit, by_cameras, measured = (
        area * (int(mask[inside].sum()) / max(n, 1))
        for mask in (
            samples.by_projectors,
            samples.lit,
            samples.by_cameras,
            samples.measured,
        )
    )
    return RegionCoverage(
        samples=n,
        reachable_by_projectors_m2=by_projectors,
        lit_m2=lit,
        reachable_by_cameras_m2=by_cameras,
        measured_m2=measured,
        uncovered_by_cause=by_cause(samples.causes[inside], area / max(n, 1)),
        measured_by={
            name: area * (count / n)
            for name, count in zip(
                cameras, samples.measured_by[inside].sum(axis=0).tolist(), strict=True
            )
            if count
        },
        floor=None,
    )


def below_floor(areas: RegionCoverage, share: float) -> tuple[bool, bool]:
    """Return whether less than a share of what can be lit is, and of the measurable."""
    lit = share * areas.reachable_by_projectors_m2 * (1.0 - _SLACK)
    measured = share * areas.reachable_by_cameras_m2 * (1.0 - _SLACK)
    return areas.lit_m2 < lit, areas.measured_m2 < measured
