"""The members of a family in a table, which may link their own pages."""

from html import escape
from pathlib import PurePosixPath

from planning.model.plan import RigPlan
from planning.report.summary.family_lines import (
    family_bounds,
    family_heads,
    family_rows,
)

from .markup import element, paragraphs, table, with_link

_PAGE = "report.html"


def family_table(plan: RigPlan, *, linked: bool) -> str:
    """Return the table and what bounds the rig; nothing of a plan for one mesh.

    `linked` says whether members' own pages are below the folder of this one.
    """
    rows = list(family_rows(plan))
    if not rows:
        return ""
    shown = next(row.cells[0] for row in rows if row.worst)
    note = (
        "Each member is measured alone. Lit and measured: of what can be. What follows "
        f"is of {shown.removesuffix(' (worst)')}."
    )
    whole = table("Members", family_heads(), [row.cells for row in rows], note)
    for row in rows if linked else ():
        page = str(PurePosixPath(row.path).with_name(_PAGE))
        whole = with_link(whole, row.cells[0], page)
    bounds = paragraphs(family_bounds(plan))
    return element("h2", escape("Family")) + whole + bounds
