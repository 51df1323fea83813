"""`report.html`: verdict, viewer, tables and wall sheet in one file, no network."""

import base64
import hashlib
from html import escape
from importlib.resources import files
from pathlib import Path, PurePath
from string import Template

import numpy as np

from geometry.arrays import Array, Ints
from geometry.parallel import mapped
from planning.model.files import write_atomically
from planning.model.plan import RigPlan
from planning.report.summary.shortfall import shortfalls
from planning.report.summary.summary import summary

from .claim_tables import claim_tables
from .device_tables import device_tables
from .facts import as_script, viewer_facts
from .family_table import family_table
from .per_face import centroids, per_face
from .verdict import verdict
from .wall_sheet import wall_sheet

PAGE = "report.html"
_GENERATOR = b'<meta name="generator" content="ringrig report">'
_NO_CLOUD = (
    " Measured errors are in the report that a checked run writes: the plan's files "
    "don't hold the measured points."
)


def pages_of(plan: RigPlan, path: Path) -> dict[Path, RigPlan]:
    """Return what is shown where: the plan, and a family's members below its folder."""
    pages = {path: plan}
    for record, member in zip(plan.document.members, plan.members, strict=False):
        pages[(path.parent / record.path).with_name(PAGE)] = member
    return pages


def write_page(
    plan: RigPlan,
    path: Path,
    *,
    threads: int,
    error_m: Array | None = None,
    linked: bool = False,
) -> None:
    """Write the report of a plan; an old file stays whole until it is complete.

    Args:
        plan: The plan; with its surface it is all that is needed.
        path: Where it goes.
        threads: Worker threads; the file doesn't depend on it.
        error_m: What `error_by_face` returned; None: no check was made in this run.
        linked: Whether members' own pages are linked, which `pages_of` tells the places
            of; a page by itself has none to link.

    Raises:
        OSError: If it can't be written.
    """
    page = page_of(plan, threads=threads, error_m=error_m, linked=linked)
    content = page.encode()
    write_atomically(path, lambda file: file.write(content))


def error_by_face(faces: Ints, distances: Array, n_faces: int) -> Array:
    """Return the mean distance of the points nearest to each face, NaN of none, (n_f,).

    Args:
        faces: Nearest face of each measured point, shape (n,).
        distances: Signed distance of each from the surface [m], shape (n,).
        n_faces: Faces of the surface.
    """
    count = np.bincount(faces, minlength=n_faces)
    total = np.bincount(faces, distances, n_faces)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def is_page(path: Path) -> bool:
    """Return whether a file is a report that was written here."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return _GENERATOR in file.read(4096)


def page_of(
    plan: RigPlan,
    *,
    threads: int,
    error_m: Array | None = None,
    linked: bool = False,
) -> str:
    """Return the page; arguments as of `write_page`."""
    samples = centroids(plan)
    facts = per_face(plan, samples, threads=threads)
    told, payload = viewer_facts(plan, samples, facts, error_m)
    # Deflating leaves the interpreter to the drawing.
    packed, wall = mapped(
        lambda made: made(), (payload.text, lambda: wall_sheet(plan)), threads
    )
    style, script = _resource("page.css"), _resource("viewer.js")
    mesh = plan.document.own_mesh.path
    title = f"Rig plan for {PurePath(mesh).name if mesh else 'a surface'}"
    document, members = plan.document, family_table(plan, linked=linked)
    footer = (
        f"Plan {plan.digest[:16]}, made {document.created} from {mesh} by "
        f"ringrig. Viewer: three.js (MIT licence, copyright three.js authors)."
    )
    return Template(_resource("page.html")).substitute(
        script_hash=_hash(script),
        style_hash=_hash(style),
        digest=plan.digest,
        title=escape(title),
        style=style,
        verdict=verdict(plan),
        remark=escape(_NO_CLOUD) if error_m is None else "",
        tables="".join((members, *device_tables(plan), *claim_tables(plan))),
        summary=escape(summary(plan, (), shortfalls(plan))),
        wall=wall,
        footer=escape(footer),
        facts=as_script(told),
        payload=packed,
        script=script,
    )


def _resource(name: str) -> str:
    return (
        files("planning.report.page").joinpath(name).read_text(encoding="utf-8").strip()
    )


def _hash(content: str) -> str:
    """Return what a content security policy knows an inline element by."""
    digest = hashlib.sha256(content.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode()}'"
