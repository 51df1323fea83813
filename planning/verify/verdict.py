"""What `plan verify` found of a plan."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from planning.model.words import count_words, printable
from planning.verify.audit.audit import Audit
from planning.verify.reconstruction.check.result import Reconstruction

_MM = 1e3


@dataclass(frozen=True, eq=False)
class Verification:
    """Whether a plan's claims hold.

    Attributes:
        failures: One sentence for each false claim, and for each limit of the check
            that isn't kept and that the plan doesn't report.
        audit: The geometric audit.
        reconstruction: The simulated one; None if it wasn't asked for.
        missed: Limits of the check that aren't kept, as the plan records itself.
        compared: How the recorded figures of the check were compared with these.
        claims_held: How closely claims were held: to the last digit, or within
            tolerances and why; "" where one is false anyway.
        trusted: What was taken on trust, since nothing here recomputes it.
        members: Of a family each member's name, and what was found of it; the audit and
            the reconstruction are then the worst member's.
    """

    failures: tuple[str, ...]
    audit: Audit
    reconstruction: Reconstruction | None
    missed: tuple[str, ...] = ()
    members: tuple[tuple[str, "Verification"], ...] = ()
    compared: str = ""
    claims_held: str = ""
    trusted: tuple[str, ...] = ()

    @property
    def is_strict(self) -> bool:
        """Whether every claim holds, and nothing was taken on trust."""
        return self.passed and not self.trusted

    @property
    def passed(self) -> bool:
        """Whether every claim holds; a plan may claim that it misses something."""
        return not self.failures

    @property
    def unmet(self) -> tuple[str, ...]:
        """Requirements and limits that the plan misses and reports: nothing false."""
        return self.audit.unmet + self.missed

    @property
    def coverage(self) -> dict[str, dict[str, float]]:
        """Recomputed areas of `surface` and `target`, keys as in the plan [m²]."""
        return self.audit.areas

    @property
    def _over_poses(self) -> list[str]:
        return [bound.line for bound in self.audit.over_poses or ()]

    def to_document(self) -> dict[str, Any]:
        """Return plain JSON values."""
        pixels = self.reconstruction
        named = {name: member.to_document() for name, member in self.members}
        return {
            "passed": self.passed,
            "failures": list(self.failures),
            "unmet": list(self.unmet),
            "coverage": self.coverage,
            "samples": len(self.audit.case.samples),
            "reconstruction": None if pixels is None else pixels.to_document(),
            "compared": self.compared,
            "claims_held": self.claims_held,
            "taken_on_trust": list(self.trusted),
            "proofs": [*self.audit.proofs, *self._over_poses],
            **({"members": named} if named else {}),
        }

    def summary(self) -> str:
        """Return the verdict for a person, in a few lines."""
        alone = self.audit.case.plan.cameras_alone
        lines = [
            f"{name}: {'verified' if member.passed else 'NOT verified'}"
            for name, member in self.members
        ]
        if lines:
            lines.append("the worst member:")
        lines += [
            _areas_line(name, self.coverage[name], alone=alone)
            for name in ("target", "surface")
        ]
        lines.append(_pixels_line(self.reconstruction))
        if self.claims_held:
            lines.append(f"claims held {self.claims_held}")
        if self.compared:
            lines.append(f"recorded figures of the check compared {self.compared}")
        bounced = self.reconstruction and self.reconstruction.record().interreflection
        if bounced and bounced.warning():
            lines.append(f"warning: {bounced.warning()}")
        lines += (*self.audit.proofs, *self._over_poses)
        lines += [f"taken on trust: {sentence}" for sentence in self.trusted]
        lines += [f"not met: {sentence}" for sentence in self.unmet]
        lines += [f"FALSE: {sentence}" for sentence in self.failures]
        checked = "pixels checked" if self.reconstruction is not None else "NOT CHECKED"
        lines.append(
            f"verified: every claim holds ({checked})"
            if self.passed
            else f"NOT verified: {count_words(len(self.failures), 'failure')}"
        )
        # Names are the file's words: they end no line, and hide none.
        return "\n".join(printable(" ".join(line.split())) for line in lines)


def _areas_line(name: str, areas: Mapping[str, float], *, alone: bool) -> str:
    cm2 = {key: f"{1e4 * area:.2f}" for key, area in areas.items()}
    if alone:
        return (
            f"{name} {cm2['area_m2']} cm², recomputed: "
            f"{cm2['reachable_by_cameras_m2']} reachable by cameras, "
            f"{cm2['measured_m2']} measured"
        )
    return (
        f"{name} {cm2['area_m2']} cm², recomputed: "
        f"{cm2['reachable_by_projectors_m2']} reachable by projectors, "
        f"{cm2['lit_m2']} lit, "
        f"{cm2['reachable_by_cameras_m2']} of it reachable by cameras, "
        f"{cm2['measured_m2']} measured"
    )


def _pixels_line(pixels: Reconstruction | None) -> str:
    if pixels is None:
        return "pixels: NOT CHECKED"
    if pixels.accuracy is None:
        return "pixels: no point was measured"
    errors, missing = pixels.accuracy, pixels.completeness.predicted_missing
    return (
        f"pixels: {pixels.n_merged} points, rms {_MM * errors.rms_m:.3f} mm, p95 "
        f"{_MM * errors.p95_m:.3f} mm, bias {_MM * errors.bias_m:.3f} mm, "
        f"predicted but missing {100 * (missing or 0.0):.2f} %"
    )
