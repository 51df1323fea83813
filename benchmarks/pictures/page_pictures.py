"""The page of the sample as Chromium shows it."""

import io
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image

from .job import ROOT, Job

sys.path.append(str(ROOT / "tests"))
from support import browser

_WINDOW = (1180, 980)


def rig(job: Job) -> Image.Image:
    """Return all devices, with the light of the projectors."""
    return _shown(
        job, lambda page: page.run("document.getElementById('show-beams').click()")
    )


def triangle(job: Job) -> Image.Image:
    """Return the object by cause, and why a triangle isn't measured."""

    def choose(page: browser.Browser) -> None:
        page.choose("view", "object")
        page.choose("layer", "cause")
        # The first that a pair lights and sees, and still doesn't measure.
        page.run(
            "const {arrays, surface, stage, choose} = ringrig;"
            "const to = stage.free.position;"
            "const codes = arrays.get('layer.cause')[0];"
            "const first = ringrig.facts.causes.light.length"
            " + ringrig.facts.causes.sight.length;"
            "const face = codes.findIndex((code, f) => code >= first && code < 255 &&"
            " surface.normal(f).dot(to.clone().sub(surface.centroid(f)).normalize())"
            " > 0.8);"
            "choose(face, surface.centroid(face));"
        )

    return _shown(job, choose)


def _shown(job: Job, arrange: Callable[[browser.Browser], object]) -> Image.Image:
    """Return the window with the viewer, without what stands about it."""
    assert job.plan
    with TemporaryDirectory() as folder:
        with browser.browser(Path(folder), _WINDOW) as page:
            page.open(job.folder / "report.html")
            page.run("document.getElementById('viewer').scrollIntoView()")
            arrange(page)
            # The next picture is drawn after the one that is waited for.
            page.run(
                "const done = arguments[0]; requestAnimationFrame(() => "
                "requestAnimationFrame(() => done()));",
                waits=True,
            )
            shown = Image.open(io.BytesIO(page.picture()))
    return shown.crop((0, 0, shown.width - 16, shown.height))
