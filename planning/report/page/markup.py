"""HTML from values: whatever comes from a file is escaped here, once."""

import re
from collections.abc import Iterable, Sequence
from html import escape

Cell = str | int | float | None


def element(name: str, content: str, **attributes: str) -> str:
    """Return an element around markup; attributes are escaped.

    `class_` becomes class, `aria_label` aria-label.
    """
    given = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape(value)}"'
        for key, value in attributes.items()
    )
    return f"<{name}{given}>{content}</{name}>"


def paragraphs(lines: Iterable[str], **attributes: str) -> str:
    """Return plain text as paragraphs; no option is broken at its hyphens."""

    def marked(line: str) -> str:
        option = r'<span class="option">\g<0></span>'
        return re.sub(r"--[a-z][a-z-]*", option, escape(line))

    return "".join(element("p", marked(line), **attributes) for line in lines)


def table(
    caption: str, head: Sequence[str], rows: Iterable[Sequence[Cell]], note: str = ""
) -> str:
    """Return a table of plain values: the first cell of a row is its heading.

    Numbers come as text, so that each column says how exactly; a cell that begins with
    a digit or a sign stands to the right. Nothing of no rows.
    """
    body = "".join(_row(row) for row in rows)
    if not body:
        return ""
    titles = "".join(element("th", escape(title), scope="col") for title in head)
    below = element("p", escape(note), class_="small") if note else ""
    parts = element("caption", escape(caption)) + element("thead", f"<tr>{titles}</tr>")
    whole = element("table", parts + element("tbody", body))
    # It scrolls by itself where it is wider than the screen, with keys too.
    scrolled = element(
        "div", whole, class_="scroll", tabindex="0", role="region", aria_label=caption
    )
    return element("div", scrolled + below, class_="entry")


def with_link(markup: str, heading: str, address: str) -> str:
    """Return a table with the heading of a row as a link."""
    plain = element("th", escape(heading), scope="row")
    link = element("a", escape(heading), href=address)
    return markup.replace(plain, element("th", link, scope="row"), 1)


def _row(cells: Sequence[Cell]) -> str:
    first, *others = (("" if cell is None else str(cell)) for cell in cells)
    return element(
        "tr",
        element("th", escape(first), scope="row") + "".join(map(_data, others)),
    )


def _data(text: str) -> str:
    number = text[:1].isdigit() or text[:1] in "+-−"
    return element("td", escape(text), **({"class_": "n"} if number and text else {}))
