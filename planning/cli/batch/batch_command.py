"""What `plan batch` does."""

import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import click

from geometry.parallel import n_threads
from planning.cli.console import print_json
from planning.cli.output_folder import exchanged
from planning.model.errors import PlanningError
from planning.model.progress import Report
from planning.model.words import count_words
from planning.rig.rig import load_rig

from .index_page import NAME as INDEX
from .index_page import write_index
from .ledger import (
    NAME,
    Row,
    asked_of,
    beside_plan,
    finished,
    is_whole,
    locked,
    read_rows,
    row_of,
    write_rows,
)
from .part_names import one_line
from .part_task import NO_FILE, PartEnd, PartTask, stop_parts
from .parts import Part, find_parts
from .parts_bar import Show, parts_progress
from .runners import cluster, local
from .sent_files import part_files, rig_files

_INTERRUPTED = 130
# Of parts whose plan is none.
_NO_PLAN = -1


@dataclass(eq=False)
class _Batch:
    """Parts, and what became of those that ended.

    Attributes:
        threads: Of each part's process.
        before: Rows of earlier runs, as this one began.
        rows: Of the parts that ended in this one, or are left as they are.
        asked: Hash of all that each part's plan follows from.
        running: Names of the parts that were given away to be planned, and haven't
            ended.
    """

    parts: Mapping[str, Part]
    out: Path
    words: Sequence[str]
    rig: Mapping[str, bytes]
    report: Report
    show: Show
    threads: int = 1
    before: Mapping[str, Row] = field(default_factory=dict[str, Row])
    rows: dict[str, Row] = field(default_factory=dict[str, Row])
    asked: dict[str, str] = field(default_factory=dict[str, str])
    running: list[str] = field(default_factory=list[str])

    def task(self, part: Part) -> PartTask:
        """Return what is planned of a part."""
        files = part_files(part.path)
        first, *others = files
        # The plan tells a part by its name, and what it refers to lies beside it.
        beside = Path(part.name).parent
        named = {part.name: files[first]}
        named |= {(beside / name).as_posix(): files[name] for name in others}
        return PartTask(part.name, named, self.rig, self.words, self.threads)

    def pending(self, *, again: bool) -> Iterator[PartTask]:
        """Yield what isn't finished; tell what is, and what can't be read."""
        for part in self.parts.values():
            try:
                task = self.task(part)
            except (PlanningError, OSError) as error:
                code = getattr(error, "exit_code", NO_FILE)
                self.end(PartEnd(part.name, code, one_line(str(error)), 0.0, {}))
                continue
            asked = self.asked[part.name] = asked_of(task)
            row = None if again else self.before.get(part.name)
            if row is not None and row.asked == asked and is_whole(row, self.out):
                check = "--no-check" not in self.words
                row = self.rows[part.name] = finished(row, self.out, check=check)
                self.report(f"{part.name}: {row.verdict}, from an earlier run")
                self.show(len(self.rows), self.running)
                continue
            self.running.append(part.name)
            self.show(len(self.rows), self.running)
            yield task

    def end(self, end: PartEnd) -> None:
        """Put what a part wrote in its place, and tell how it ended."""
        part, asked = self.parts[end.name], self.asked.get(end.name, "")
        try:
            if end.code in (0, 1):
                _keep(end.files, self.out / part.folder)
            row = row_of(end, part.folder, self.out, asked)
        except (PlanningError, OSError) as error:
            # A full disk, or whatever a worker sent: the others go on.
            code = NO_FILE if isinstance(error, OSError) else _NO_PLAN
            failed = replace(end, code=code, message=one_line(str(error)))
            row = row_of(failed, "", self.out, "")
        self.rows[end.name] = row
        if end.name in self.running:
            self.running.remove(end.name)
        self.write()
        why = f": {row.message}" if row.failed and row.message else ""
        n = f"{len(self.rows)} of {len(self.parts)}"
        self.report(f"{end.name}: {row.verdict}{why} ({n})")
        self.show(len(self.rows), self.running)

    def write(self) -> None:
        """Write the table and the page of what ended so far, in other runs too."""
        with locked(self.out):
            # Another batch may have written since this one began.
            now = {**self.before, **_before(read_rows(self.out), self.parts, self.out)}
            ours = {
                name: beside_plan(row, now.get(name))
                for name, row in self.rows.items()
                if row != self.before.get(name)
            }
            rows = [*{**now, **ours}.values()]
            write_rows(rows, self.out)
            write_index(rows, self.out)


def _keep(files: Mapping[str, bytes], folder: Path) -> None:
    folder.parent.mkdir(parents=True, exist_ok=True)
    with exchanged(folder) as fresh:
        for name, content in files.items():
            path = fresh / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)


def _before(
    rows: Mapping[str, Row], parts: Mapping[str, Part], out: Path
) -> dict[str, Row]:
    """Return the rows of earlier runs: these parts', and others' that still hold.

    One holds where no plan is told of, or that plan stands where none of these goes.
    """
    folders = {part.folder for part in parts.values()}

    def holds(row: Row) -> bool:
        if row.part in parts:
            return row.folder in ("", parts[row.part].folder)
        return row.failed or (_stands(row, out) and row.folder not in folders)

    return {name: row for name, row in rows.items() if holds(row)}


def _stands(row: Row, out: Path) -> bool:
    return (out / row.folder / "plan.json").exists()


def batch_command(
    options: Mapping[str, Any], given: Sequence[str], words: Sequence[str]
) -> int:
    """Plan every part that isn't finished; return 0 if all meet what is asked.

    Args:
        options: Of the command line.
        given: Folders, patterns and files of the parts.
        words: Options of each part's own command line.
    """
    # What is wrong with the rig is wrong with every part.
    load_rig(options["rig_name"], options["light"])
    out = Path(options["output"])
    rows = read_rows(out)
    stand = {row.part: row.folder for row in rows.values() if _stands(row, out)}
    parts = {part.name: part for part in find_parts(given, out, stand)}
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise click.UsageError(f"{out}: can't be written ({error.strerror})") from None
    rig = rig_files(options["rig_name"])
    jobs = options["jobs"] or max(1, n_threads() // 2)
    threads, before = max(1, n_threads() // jobs), _before(rows, parts, out)
    interrupted = False
    with ExitStack() as stack:
        bar = parts_progress(len(parts), quiet=options["quiet"])
        report, show = stack.enter_context(bar)
        batch = _Batch(parts, out, words, rig, report, show, threads, before)
        if options["scheduler"] is None:
            run = stack.enter_context(local(jobs))
        else:
            run, count = stack.enter_context(cluster(options["scheduler"]))
            report(f"{options['scheduler']}: {count_words(count, 'worker')}")
            batch.threads = options["threads"] or 1
        if options["threads"]:
            batch.threads = options["threads"]
        with suppress(KeyboardInterrupt):
            interrupted = True
            with closing(run(batch.pending(again=options["again"]))) as ends:
                for end in ends:
                    batch.end(end)
            interrupted = False
        if interrupted:
            stop_parts()
    batch.write()
    return _told(batch, options, interrupted=interrupted)


def _told(batch: _Batch, options: Mapping[str, Any], *, interrupted: bool) -> int:
    rows = sorted(batch.rows.values(), key=lambda row: row.part)
    missed = [row for row in rows if row.exit == 1]
    failed = [row for row in rows if row.failed]
    if options["as_json"]:
        print_json(
            {
                "parts": len(batch.parts),
                "met": sum(row.exit == 0 for row in rows),
                "missed": [row.part for row in missed],
                "failed": {row.part: row.message for row in failed},
                "files": [str(batch.out / NAME), str(batch.out / INDEX)],
            }
        )
    else:
        met = sum(row.exit == 0 for row in rows)
        click.echo(f"{met} of {len(batch.parts)} parts are measured as asked")
        for title, some in (("MISSED", missed), ("FAILED", failed)):
            width = min(shutil.get_terminal_size().columns, 100)
            for row in some:
                line = f"{title}   {row.part}: {row.message}"
                click.echo(line if len(line) <= width else f"{line[: width - 4]} ...")
        click.echo(f"FILES    {batch.out}: {NAME}, {INDEX}, a folder for each part")
    if interrupted:
        return _INTERRUPTED
    return 1 if missed or failed or len(rows) < len(batch.parts) else 0
