"""A plan in the hands of a designer: tables, pictures, and itself in a notebook."""

import html
import webbrowser
from pathlib import Path
from tempfile import mkdtemp
from typing import Self

from PIL import Image

from geometry.mesh.mesh import TriangleMesh
from geometry.parallel import n_threads
from planning.model.plan import RigPlan
from planning.report.drawing.face_colours import face_status
from planning.report.drawing.rig_picture import draw_rig
from planning.report.made_again import again_or_why_not
from planning.report.page.page import PAGE, page_of, write_page
from planning.report.summary.shortfall import shortfalls
from planning.verify.reconstruction.check.result import Reconstruction
from planning.verify.reconstruction.pattern_files import write_patterns
from planning.verify.reconstruction.reconstruct import reconstruct
from planning.verify.reconstruction.scanner import Scanner
from planning.verify.verdict import Verification
from planning.verify.verification import verify_plan

from .plan_tables import Table, coverage_rows, device_rows, region_rows, table
from .plots import PLOTS, Axes, new_axes

# Of the report in a notebook.
_FRAME_PX = 900


class HandedPlan(RigPlan):
    """A plan as `plan_rig` returns it; `planning.RigPlan` is this class."""

    @classmethod
    def of(cls, plan: RigPlan) -> Self:
        """Return a plan of the planner in this form."""
        members = tuple(map(cls.of, plan.members))
        return cls(plan.document, plan.surface, members, plan.proof)

    @property
    def missed(self) -> tuple[str, ...]:
        """What of the requirements it misses, a text each; empty: it meets them."""
        return shortfalls(self)

    @property
    def devices(self) -> Table:
        """Projectors and cameras in rows: position [mm], angles [degrees], area."""
        return table(device_rows(self))

    @property
    def coverage_table(self) -> Table:
        """Areas of target and surface in [cm²], each with its denominator."""
        return table(coverage_rows(self))

    @property
    def regions_table(self) -> Table:
        """Dominant regions in rows: area, and what of it is lit and measured."""
        return table(region_rows(self))

    def verify(
        self,
        mesh: TriangleMesh | None = None,
        *,
        seed: int | None = None,
        threads: int | None = None,
    ) -> Verification:
        """Recompute every claim and check from pixels, as `verify_plan` does."""
        return verify_plan(
            self, mesh, seed=seed, threads=threads, again=again_or_why_not
        )

    def reconstruct(
        self, *, seed: int | None = None, threads: int | None = None
    ) -> Reconstruction:
        """Render what cameras would see of it, decode and triangulate that.

        Args:
            seed: Of noise; None: the plan's.
            threads: Worker threads. None: all cores.
        """
        seed = self.document.seed if seed is None else seed
        return reconstruct(Scanner.of(self), seed=seed, threads=threads)

    def draw(self, size: tuple[int, int] = (1600, 1000)) -> Image.Image:
        """Return the picture that a run writes as `rig.png`."""
        return draw_rig(
            self, face_status=face_status(self, threads=n_threads()), size=size
        )

    def patterns(self, folder: str | Path) -> Path:
        """Write what each projector shows into a folder; return where they are."""
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        return write_patterns(Scanner.of(self), folder)

    def plot(self, what: str = "marginal", ax: Axes | None = None) -> Axes:
        """Draw a figure of the plan on Matplotlib axes, and return these.

        Args:
            what: `marginal`: coverage by the number of devices; `regions`: lit and
                measured shares; `sigma`: terms of the error budget.
            ax: Axes to draw on; None: new ones.

        Raises:
            ValueError: If there is no such figure.
            ImportError: If Matplotlib is missing (`pip install 'ringrig[plot]'`).
        """
        if what not in PLOTS:
            raise ValueError(f"plot {what!r} is none of {', '.join(PLOTS)}")
        if ax is None:
            ax = new_axes()
        PLOTS[what](self, ax)
        return ax

    def show(self, path: str | Path | None = None) -> Path:
        """Write the report, open it in a browser, and return where it is.

        Args:
            path: Where it goes; None: a file in a folder of its own that stays.
        """
        path = Path(mkdtemp(prefix="ringrig-")) / PAGE if path is None else Path(path)
        write_page(self, path, threads=n_threads())
        webbrowser.open(path.resolve().as_uri())
        return path

    def _repr_html_(self) -> str:
        """Return the report in a frame, for a notebook."""
        page = html.escape(page_of(self, threads=n_threads()), quote=True)
        return (
            f'<iframe title="report of the rig" srcdoc="{page}" width="100%" '
            f'height="{_FRAME_PX}" style="border:0"></iframe>'
        )
