"""`index.html` of a batch: a table of its parts, with links to their pages."""

import base64
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path

from planning.model.files import write_atomically
from planning.model.words import percent
from planning.report.page.markup import element, table, with_link
from planning.report.page.page import PAGE

from .ledger import Row

NAME = "index.html"
_PICTURE = "rig.png"
_HEADS = (
    *("part", "verdict", "projectors", "cameras", "lit", "measured"),
    *("of the target", "check, rms [mm]", "time [s]", "why"),
)
_NOTE = (
    "At least so many devices are needed, as proved over the candidates. Lit and "
    "measured: of what can be; the target's area and more stand in batch.csv."
)


def write_index(rows: Sequence[Row], out: Path) -> None:
    """Write the page whole; it needs no network."""
    write_atomically(out / NAME, lambda file: file.write(_page(rows, out).encode()))


def _page(rows: Sequence[Row], out: Path) -> str:
    ordered = sorted(rows, key=lambda row: (not row.failed, row.exit == 0, row.part))
    cells = [_cells(row) for row in ordered]
    whole = table("Parts", _HEADS, cells, _NOTE)
    for row in ordered:
        if _stands(row, out, PAGE):
            whole = with_link(whole, row.part, f"{row.folder}/{PAGE}")
    met, missed = (sum(row.exit == code for row in rows) for code in (0, 1))
    failed = len(rows) - met - missed
    words = f"{met} of {len(rows)} parts are measured as asked"
    if missed:
        words += f", {missed} miss a requirement"
    if failed:
        words += f", {failed} failed"
    kind = "missed" if failed or missed else "met"
    verdict = element("p", escape(words), class_=f"verdict {kind}")
    style = files("planning.report.page").joinpath("page.css").read_text("utf-8")
    pictures = "".join(_picture(row, out) for row in ordered)
    head = (
        '<meta charset="utf-8"><meta http-equiv="Content-Security-Policy" content="'
        "default-src 'none'; style-src 'unsafe-inline'; img-src data:\">"
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="generator" content="ringrig batch">'
        f"<title>Batch of {len(rows)} parts</title><style>{style}</style>"
    )
    body = element("h1", f"Batch of {len(rows)} parts") + element(
        "main", verdict + whole + pictures
    )
    whole = element("head", head) + element("body", body)
    return f"<!DOCTYPE html>\n{element('html', whole, lang='en')}\n"


def _cells(row: Row) -> list[str]:
    return [
        row.part,
        row.verdict,
        _counted(row.projectors, row.projectors_least),
        _counted(row.cameras, row.cameras_least),
        _percent(row.lit, row.lit_asked),
        _percent(row.measured, row.measured_asked),
        _percent(row.of_target),
        row.rms_mm,
        row.seconds,
        row.message,
    ]


def _counted(count: str, least: str) -> str:
    if not count or not least:
        return count
    return count if count == least else f"{count}, at least {least}"


def _percent(share: str, asked: str = "") -> str:
    return percent(float(share), asked=float(asked or 0.0)) if share else ""


def _stands(row: Row, out: Path, name: str) -> bool:
    # Where a part failed, its folder may hold an older plan, which its row isn't of.
    return not row.failed and (out / row.folder / name).exists()


def _picture(row: Row, out: Path) -> str:
    if not _stands(row, out, _PICTURE):
        return ""
    data = base64.b64encode((out / row.folder / _PICTURE).read_bytes()).decode()
    image = element(
        "img", "", src=f"data:image/png;base64,{data}", alt=row.part, width="400"
    ).removesuffix("</img>")
    caption = element("figcaption", escape(row.part))
    return element("figure", image + caption)
