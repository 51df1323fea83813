"""`batch.csv`: a line a part, which a later run knows finished parts by."""

import csv
import hashlib
import io
import json
import os
from collections.abc import Generator, Iterable, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass, fields, replace
from math import isfinite
from pathlib import Path
from platform import machine

from planning.cache.content import content
from planning.model.document.made_with import MadeWith
from planning.model.files import write_atomically
from planning.model.plan import RigPlan
from planning.report.summary.shortfall import missing
from planning.steps.checked import missed_by

from .part_task import PartEnd, PartTask

NAME = "batch.csv"
# What tells which plan stands, and where.
_OF_PLAN = ("folder", "asked", "digest", "files", "content")
_SHARES = ("lit", "measured", "lit_asked", "measured_asked", "of_target")
_VERDICTS = {0: "met", 1: "NOT MET", 130: "interrupted"}


@dataclass(frozen=True)
class Row:
    """What became of a part; shares are of what can be reached, empty: no plan.

    Attributes:
        part: Its name.
        folder: Of its plan.
        exit: Of its run.
        verdict: In a word or two.
        projectors_least: Needed, as proved over the candidates, however many there
            may be; of cameras likewise.
        lit: Share of what projectors can reach of the target.
        measured: Share of what cameras can reach of what is lit.
        lit_asked: What the first must be, `measured_asked` the second.
        of_target: Measured share of the whole target.
        target_cm2: Its area.
        rms_mm: Of the check from pixels.
        seconds: Wall time of the run.
        message: Why not, in a line.
        asked: Hash of the mesh file and of everything that is asked. Where a part
            failed, this and what follows are of the plan that an earlier run left, if
            one did.
        digest: Of the plan (`RigPlan.digest`).
        files: What its run wrote into the folder: files and folders, by their names.
        content: Hash of all of it.
    """

    part: str
    folder: str
    exit: int
    verdict: str
    projectors: str = ""
    projectors_least: str = ""
    cameras: str = ""
    cameras_least: str = ""
    lit: str = ""
    measured: str = ""
    lit_asked: str = ""
    measured_asked: str = ""
    of_target: str = ""
    target_cm2: str = ""
    rms_mm: str = ""
    seconds: str = ""
    message: str = ""
    asked: str = ""
    digest: str = ""
    files: str = ""
    content: str = ""

    @property
    def failed(self) -> bool:
        """Whether there is no plan, or one that wasn't made to its end."""
        return self.exit not in (0, 1)


def made_here() -> str:
    """Return a hash of all code and libraries that make plans here, and check them."""
    made = MadeWith.here()
    return content(made.code, made.libraries, machine())


def asked_of(task: PartTask) -> str:
    """Return a hash of all that a part's plan follows from, hexadecimal."""
    words = json.dumps([made_here(), *task.words])
    return _hash_of(words, (*task.mesh.items(), *task.rig.items()))


def _hash_of(words: str, files: Iterable[tuple[str, bytes]]) -> str:
    hashed = hashlib.sha256(words.encode())
    for name, data in files:
        hashed.update(f"{name}:{len(data)};".encode() + data)
    return hashed.hexdigest()


def row_of(end: PartEnd, folder: str, out: Path, asked: str) -> Row:
    """Return the row of a part that ended, whose files stand in their folder."""
    verdict = _VERDICTS.get(end.code, "failed")
    row = Row(
        end.name,
        folder,
        end.code,
        verdict,
        seconds=f"{end.seconds:.1f}",
        message=end.message if end.code not in (0, 1) else "",
        asked=asked,
    )
    if end.code not in (0, 1):
        return row
    names = {name.split("/")[0] for name in end.files}
    written, content = " ".join(sorted(names)), _hash_of("", sorted(end.files.items()))
    plan = RigPlan.load(out / folder / "plan.json")
    return _with_plan(replace(row, files=written, content=content), plan)


def beside_plan(row: Row, before: Row | None) -> Row:
    """Return the row of a part that failed as it also tells what an earlier run left.

    That plan stands, and needn't be made again where the same is asked again.
    """
    if not row.failed or before is None or not before.content:
        return row
    kept = {name: getattr(before, name) for name in _OF_PLAN}
    return replace(row, **kept)


def finished(row: Row, out: Path, *, check: bool) -> Row:
    """Return the row of a plan that is whole, also where a later run of it failed."""
    if not row.failed:
        return row
    plan = RigPlan.load(out / row.folder / "plan.json")
    code = 1 if missed_by(plan, check=check) else 0
    kept = {name: getattr(row, name) for name in _OF_PLAN}
    return _with_plan(Row(row.part, exit=code, verdict=_VERDICTS[code], **kept), plan)


def _with_plan(row: Row, plan: RigPlan) -> Row:
    areas, proofs = plan.coverage.target, plan.document.certificates
    asked = plan.requirements
    check, lights = plan.document.reconstruction, proofs.projectors
    missed = [one.figure for one in missing(plan)]
    if row.exit == 1 and not missed:
        # All is met, and there was no time for the check.
        missed = missed_by(plan, check=True)
    if check is None and row.exit == 0:
        row = replace(row, verdict="met, NOT CHECKED")
    return replace(
        row,
        projectors=str(len(plan.projectors)),
        projectors_least="" if lights is None else str(lights.needed.lower_bound),
        cameras=str(len(plan.cameras)),
        cameras_least=str(proofs.cameras.needed.lower_bound),
        lit=_share(areas.lit_m2, areas.reachable_by_projectors_m2),
        measured=_share(areas.measured_m2, areas.reachable_by_cameras_m2),
        lit_asked=f"{asked.dominant_coverage:g}",
        measured_asked=f"{asked.coverage:g}",
        of_target=_share(areas.measured_m2, areas.area_m2),
        target_cm2=f"{1e4 * areas.area_m2:.2f}",
        rms_mm=""
        if check is None or check.accuracy_rms_m is None
        else f"{1e3 * check.accuracy_rms_m:.4f}",
        message="; ".join(missed),
        digest=plan.digest,
    )


def _share(part: float, whole: float) -> str:
    # To the last digit: whoever shows it rounds once.
    return str(part / whole) if whole > 0.0 else ""


@contextmanager
def locked(out: Path) -> Generator[None]:
    """Keep other batches from this folder's table meanwhile, where the system can."""
    with ExitStack() as stack:
        # Windows has no `fcntl`, and some network folders no locks.
        with suppress(ImportError, OSError):
            from fcntl import LOCK_EX, flock

            handle = os.open(out, os.O_RDONLY)
            stack.callback(os.close, handle)
            flock(handle, LOCK_EX)
        yield


def write_rows(rows: Iterable[Row], out: Path) -> None:
    """Write the table whole, in the order of the parts' names."""
    text = io.StringIO()
    names = [field.name for field in fields(Row)]
    table = csv.DictWriter(text, names, lineterminator="\n")
    table.writeheader()
    table.writerows(asdict(row) for row in sorted(rows, key=lambda row: row.part))
    write_atomically(
        out / NAME, lambda file: file.write(text.getvalue().encode("utf-8"))
    )


def read_rows(out: Path) -> Mapping[str, Row]:
    """Return the rows of an earlier run by part, but for those that aren't any."""
    names = {field.name for field in fields(Row)}
    rows: dict[str, Row] = {}
    with suppress(OSError, UnicodeDecodeError, csv.Error):
        text = (out / NAME).read_text("utf-8")
        for line in csv.DictReader(io.StringIO(text)):
            if set(line) == names and all(v is not None for v in line.values()):
                with suppress(ValueError):
                    row = _row(line)
                    rows[row.part] = row
    return rows


def _row(line: Mapping[str, str]) -> Row:
    """Return a line of the table.

    Raises:
        ValueError: If a share isn't a number, or the exit code none.
    """
    if not all(isfinite(float(line[name] or 0.0)) for name in _SHARES):
        raise ValueError
    return Row(**{**line, "exit": int(line["exit"])})  # type: ignore[arg-type]


def is_whole(row: Row, out: Path) -> bool:
    """Return whether all that a part's run wrote stands in its folder as it was."""
    folder = out / row.folder
    own = [folder / name for name in row.files.split()]
    with suppress(OSError):
        files = {
            path.relative_to(folder).as_posix(): path.read_bytes()
            for one in own
            for path in (one, *one.rglob("*"))
            if path.is_file()
        }
        return _hash_of("", sorted(files.items())) == row.content
    return False
