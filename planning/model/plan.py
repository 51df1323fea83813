"""The plan: its document and surface, and the errors that carry one."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO, Self, cast

import numpy as np
from pydantic import ValidationError

from geometry.files.file_content import file_content
from planning.model.document.coverage_records import Coverage, RegionRecord
from planning.model.document.plan_document import FORMAT, VERSION, PlanDocument
from planning.model.document.survival_records import SurvivalRecord

from .devices.planned import PlannedCamera, PlannedProjector
from .errors import InputError, PlanFileError, PlanningError
from .files import plain_json, reading, unusable_numbers, write_together
from .proofs import ProofFile
from .requirements import Requirements
from .surface import Surface

# Keys that tell how a plan came about and how its check ended.
_NOT_PLANNED = {
    *("created", "made_with", "command", "truncated", "members"),
    *("reconstruction", "cost", "timings_s"),
}
# So many faults of a file are told; a file of another kind has hundreds.
_MOST_FAULTS = 20


@dataclass(frozen=True, eq=False)
class RigPlan:
    """A plan, as written.

    Attributes:
        document: What `plan.json` holds.
        surface: The surface that its claims speak about.
        members: Of a family's plan each member's own; else none.
        proof: What its bounds over the candidates are derived from; None: nothing is
            there.
    """

    document: PlanDocument
    surface: Surface
    members: tuple["RigPlan", ...] = ()
    proof: ProofFile | None = None

    @property
    def of_member(self) -> bool:
        """Whether this is the plan of one member, whose rig is a family's."""
        return not self.members and any(record.name for record in self.document.members)

    @property
    def served(self) -> tuple[tuple[str, "RigPlan"], ...]:
        """Name and plan of each member that the rig must serve; none: no family."""
        family = self.document.family
        if family is None:
            return ()
        pairs = zip(self.document.members, self.members, strict=True)
        return tuple(
            (record.name, plan)
            for m, (record, plan) in enumerate(pairs)
            if m not in family.left_out
        )

    @property
    def requirements(self) -> Requirements:
        """What was asked of the plan."""
        return self.document.requirements

    @property
    def cameras_alone(self) -> bool:
        """Whether there is no projector, and pairs of cameras measure by texture."""
        return self.requirements.pattern == "none"

    def require_projectors(self, what: str) -> None:
        """Refuse what is made with projectors where there are none.

        Raises:
            InputError: If cameras measure alone.
        """
        if self.cameras_alone:
            raise InputError(
                f"{what} needs projectors, and this plan's pattern is 'none'; `plan "
                f"verify` renders and matches what its cameras see"
            )

    @cached_property
    def projectors(self) -> tuple[PlannedProjector, ...]:
        """The projectors, in the order of the file."""
        return tuple(record.planned() for record in self.document.projectors)

    @cached_property
    def cameras(self) -> tuple[PlannedCamera, ...]:
        """The cameras, in the order of the file."""
        return tuple(record.planned() for record in self.document.cameras)

    @property
    def coverage(self) -> Coverage:
        """Areas of the surface and the target, and what isn't covered, by cause."""
        return self.document.coverage

    @property
    def regions(self) -> tuple[RegionRecord, ...]:
        """The dominant regions, and what becomes of each."""
        return self.document.regions

    @property
    def survival(self) -> SurvivalRecord | None:
        """What is left after losses; None where none are to be survived."""
        return self.document.survival

    @property
    def large_regions(self) -> tuple[RegionRecord, ...]:
        """The regions that a floor is for, by their areas as they are claimed."""
        least = self.requirements.region_share * self.coverage.target.area_m2
        return tuple(
            region
            for region in self.document.regions
            if region.area_m2 >= least * (1.0 - 1e-9)
        )

    @cached_property
    def digest(self) -> str:
        """SHA-256 of what was planned, whether or not it was checked, hexadecimal.

        Every file that a plan is used with carries it: patterns, picture and cloud.
        """
        document = self.to_document()
        planned = {key: document[key] for key in document if key not in _NOT_PLANNED}
        return hashlib.sha256(json.dumps(planned).encode()).hexdigest()

    def save(self, path: str | Path) -> None:
        """Write the plan, and `surface.npz` beside it; of a family all members' too.

        Args:
            path: Where `plan.json` goes; its folder is made if need be.

        Raises:
            OSError: If the folder can't be written.
        """
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        # A plan whose members aren't there yet is no plan of a family.
        for record, member in zip(self.document.members, self.members, strict=False):
            member.save(path.parent / record.path)
        surface = path.parent / self.document.surface.path
        record, proof = self.document.certificates.proof, self.proof
        files: dict[Path, Callable[[BinaryIO], object]] = {
            surface: lambda file: file.write(self.surface.content),
            path: lambda file: file.write(self.to_json().encode()),
        }
        if record is not None and proof is not None:
            files[path.parent / record.path] = lambda file: file.write(proof.content)
        write_together(files)

    def to_json(self) -> str:
        """Return the document as JSON text."""
        # A surface that was read may be packed otherwise by this numpy.
        document = self.to_document()
        document["surface"]["sha256"] = self.surface.sha256()
        return json.dumps(document, indent=1, allow_nan=False) + "\n"

    def to_document(self) -> dict[str, Any]:
        """Return fresh plain JSON values, keys in the order of the file."""
        return self.document.to_document()

    @classmethod
    def from_document(cls, document: dict[str, Any], surface: Surface) -> Self:
        """Return the plan of plain JSON values, as `to_document` gives them.

        Raises:
            PlanFileError: If a value is missing or can't be used.
        """
        read = _document(json.dumps(document), "plan")
        _check_references(read, surface, "plan")
        return cls(read, surface)

    @classmethod
    def load(cls, path: str | Path, *, of_family: bool = False) -> Self:
        """Read a plan, by its file or folder; a member `of_family` is no family itself.

        Raises:
            PlanFileError: If a file is missing, isn't a plan of a version that is
                understood, or doesn't belong to the other.
        """
        path = Path(path, "plan.json") if Path(path).is_dir() else Path(path)
        with reading(path, PlanFileError):
            content = file_content(path)
        document = _document(content, str(path))
        # Before its own members are read, which may lead back here.
        if of_family and document.family is not None:
            raise PlanFileError(f"{path}: a member is a family itself; plan again")
        surface = document.surface
        loaded = Surface.load(path.parent / surface.path, surface.sha256)
        _check_references(document, loaded, str(path))
        record = document.certificates.proof
        proof = record and ProofFile.load(path.parent / record.path, record.sha256)
        return cls(document, loaded, cls._members(path, document), proof)

    @classmethod
    def _members(cls, path: Path, document: PlanDocument) -> tuple[Self, ...]:
        """Read the plans of a family's members, which lie below the family's."""
        if document.family is None:
            return ()
        members: list[Self] = []
        for record in document.members:
            if record.path != member_path(record.name):
                raise PlanFileError(
                    f"{path}: member {record.name!r} lies in {record.path!r}, must be "
                    f"{member_path(record.name)!r}; plan again"
                )
            members.append(cls.load(path.parent / record.path, of_family=True))
        return tuple(members)


def member_path(name: str) -> str:
    """Return where the plan of a member lies, beside the plan of the family."""
    return f"members/{name}/plan.json"


def _require_plan(document: object, where: str) -> None:
    """Refuse what isn't a plan of our version, or has numbers that none can use."""
    values = cast(dict[str, Any], document) if isinstance(document, dict) else {}
    if values.get("format") != FORMAT:
        raise PlanFileError(f"{where}: not a plan, its `format` must be '{FORMAT}'")
    version = values.get("version")
    # To Python 1.0 and True are 1, too.
    if type(version) is not int or version != VERSION:
        told = repr(version)[:60]
        raise PlanFileError(f"{where}: version {told}, this program reads {VERSION}")
    if faults := list(unusable_numbers(values))[:_MOST_FAULTS]:
        lines = (f"{where}: {fault}; plan again" for fault in faults)
        raise PlanFileError("\n".join(lines))


def _document(text: str | bytes, where: str) -> PlanDocument:
    try:
        values = plain_json(text)
    except (ValueError, RecursionError) as error:
        raise PlanFileError(f"{where}: not readable as JSON ({error})") from None
    _require_plan(values, where)
    try:
        document = PlanDocument.read(text)
        for record in (*document.projectors, *document.cameras):
            record.planned()
    except ValidationError as error:
        faults = [f"{where}: {fault}; plan again" for fault in _faults(error)]
        raise PlanFileError("\n".join(faults)) from None
    except ValueError as error:
        raise PlanFileError(f"{where}: broken plan ({error}); plan again") from None
    return document


def _check_references(document: PlanDocument, surface: Surface, where: str) -> None:
    """Refuse places that aren't in the rig, or among the reference poses."""
    for kind in ("projector", "camera"):
        models, n = surface.models_of(kind), len(document.rig.models(kind))
        if not np.all((models >= 0) & (models < n)):
            raise PlanFileError(
                f"{where}: reference_{kind}_models of {document.surface.path} names "
                f"models {models.min()} to {models.max()}, the rig has {n}; plan again"
            )
        for place, row in enumerate(document.marginal):
            named = (row.reference or ()) if row.number[0] == kind else ()
            if max(named, default=-1) >= len(models):
                raise PlanFileError(
                    f"{where}: marginal.{place}.reference names pose {max(named)}, "
                    f"{document.surface.path} holds {len(models)}; plan again"
                )


def _faults(error: ValidationError) -> list[str]:
    """Return the faults, up to so many: where, the value, the rule."""
    entries = error.errors(include_url=False)
    faults: list[str] = []
    for entry in entries[:_MOST_FAULTS]:
        where = ".".join(map(str, entry["loc"])) or "the file"
        rule = entry["msg"].removeprefix("Value error, ")
        rule = rule.removeprefix("Input ").removeprefix("Tuple ")
        value = repr(entry["input"])
        value = value if len(value) <= 60 else f"{value[:57]}..."
        missing = entry["type"] == "missing"
        faults.append(f"{where} is missing" if missing else f"{where} = {value} {rule}")
    more = len(entries) - len(faults)
    return [*faults, f"{more} more faults"] if more else faults


class RequirementError(PlanningError):
    """A plan was made, but it misses a requirement.

    Attributes:
        plan: The best plan found.
        shortfalls: One sentence for each missed requirement, with its cause.
    """

    exit_code = 1

    def __init__(self, plan: RigPlan, shortfalls: tuple[str, ...]) -> None:
        super().__init__("; ".join(shortfalls))
        self.plan = plan
        self.shortfalls = shortfalls


class InterruptedPlanError(PlanningError):
    """The run was interrupted after a first plan stood.

    Attributes:
        plan: The best plan so far, marked `truncated`.
    """

    exit_code = 130

    def __init__(self, plan: RigPlan) -> None:
        super().__init__("interrupted; the best plan so far is kept")
        self.plan = plan
