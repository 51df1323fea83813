"""What `plan show` prints, section by section: a heading, a sentence, and figures."""

from collections.abc import Callable
from dataclasses import dataclass

from planning.model.plan import RigPlan
from planning.report.tolerance.joint_lines import joint_lines
from planning.report.tolerance.robust_lines import robust_lines
from planning.report.tolerance.survival_lines import survival_lines

from .check_lines import check_lines, cost_lines
from .coverage_lines import coverage_lines, marginal_lines, schedule_lines
from .devices.device_lines import (
    device_lines,
    gap_lines,
    mount_lines,
)
from .devices.station_lines import station_lines
from .devices.zone_lines import zone_lines
from .family_lines import family_lines
from .light_lines import light_lines
from .proof_lines import proof_lines
from .region_lines import region_table
from .ring_lines import code_lines, range_lines, ring_lines


@dataclass(frozen=True)
class Section:
    """One of the sections.

    Attributes:
        name: Its option.
        says: What its figures are, in a sentence.
        lines: Returns them.
    """

    name: str
    says: str
    lines: Callable[[RigPlan], list[str]]

    def told(self, plan: RigPlan) -> list[str]:
        """Return heading, sentence and figures; nothing where a plan has none."""
        lines = self.lines(plan)
        while lines and not lines[0]:
            lines = lines[1:]
        return [f"{self.name.upper()}: {self.says}", *lines, ""] if lines else []


SECTIONS = (
    Section(
        "places",
        "object, zones and devices in the axes of the mesh file, as one mounts them.",
        lambda plan: [
            *zone_lines(plan),
            *device_lines(plan),
            *gap_lines(plan),
            *mount_lines(plan),
        ],
    ),
    Section(
        "stations",
        "heads, stations or steps with their devices, and what trades against what.",
        station_lines,
    ),
    Section(
        "family",
        "members that the rig measures one at a time, and what bounds their rig.",
        family_lines,
    ),
    Section(
        "coverage",
        "areas that are lit and measured, of what can be, and what is left out.",
        lambda plan: [
            *coverage_lines(plan),
            *light_lines(plan),
            *survival_lines(plan),
            *robust_lines(plan),
        ],
    ),
    Section(
        "proofs",
        "what was proved of the numbers of devices, and over which poses.",
        lambda plan: [*proof_lines(plan), *joint_lines(plan)],
    ),
    Section(
        "marginal",
        "what one device more or fewer would light and measure.",
        lambda plan: [] if plan.document.evaluation else marginal_lines(plan),
    ),
    Section(
        "regions",
        "every region, where it lies, and what of it is lit and measured.",
        region_table,
    ),
    Section(
        "rings",
        "how the circles of each projector are spaced, and what becomes of them.",
        lambda plan: [
            *range_lines(plan.document),
            *ring_lines(plan),
            *code_lines(plan),
        ],
    ),
    Section(
        "check",
        "the reconstruction from rendered pixels, against the mesh.",
        check_lines,
    ),
    Section(
        "cost",
        "how long a scan takes, and eq. (8) of the paper with its terms.",
        lambda plan: [*schedule_lines(plan.document), *cost_lines(plan.document)],
    ),
)
