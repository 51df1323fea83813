"""The plans that a run writes into its folder, of which the last stands there."""

from contextlib import ExitStack, suppress
from pathlib import Path

from geometry.arrays import Array
from planning.cli.output_folder import OWNED, check_ours, exchanged, uninterrupted
from planning.model.errors import TimeLimitError
from planning.model.plan import RigPlan
from planning.model.progress import TIME_IS_UP, Report, Stopwatch, untimed
from planning.model.words import shell_word
from planning.report.drawing.face_colours import face_status
from planning.report.drawing.picture_view import save_picture
from planning.report.drawing.rig_picture import draw_rig
from planning.report.page.page import (
    PAGE,
    error_by_face,
    is_page,
    pages_of,
    write_page,
)
from planning.verify.reconstruction.pattern_files import write_patterns
from planning.verify.reconstruction.scanner import Scanner
from planning.verify.verdict import Verification


class SavedPlans:
    """Saves plans whole, each in the place of the one before.

    Args:
        folder: Where they go.
        report: Receives a line before what takes long.
        patterns: Whether the images to project are written too.

    Raises:
        FileExistsError: If something of another's would have to give way.
    """

    def __init__(self, folder: Path, report: Report, *, patterns: bool) -> None:
        # Before the work, not after it.
        check_ours(folder)
        self._folder, self._report, self._patterns = folder, report, patterns
        self.last: RigPlan | None = None
        self._errors: dict[str, Array] = {}

    @property
    def files(self) -> list[str]:
        """What stands in the folder of a plan."""
        paths = [self._folder / name for name in OWNED]
        return [str(path) for path in paths if path.exists()]

    def keep(self, plan: RigPlan) -> None:
        """Save a plan that isn't checked; Ctrl-C waits until it is saved.

        Raises:
            TimeLimitError: If the time limit came first; the one before stands.
        """
        with uninterrupted():
            self._save(plan)
        self._report(f"written to {self._folder}, NOT CHECKED yet")

    def checked(self, plan: RigPlan, verification: Verification) -> None:
        """Keep what the check measured of each face, for the page."""
        check = verification.reconstruction
        if check is not None and check.accuracy is not None:
            faces, distances = check.accuracy.faces, check.accuracy.distances
            n_faces = len(plan.surface.mesh.faces)
            self._errors[plan.digest] = error_by_face(faces, distances, n_faces)

    def write_page(self, plan: RigPlan, clock: Stopwatch, threads: int) -> None:
        """Write `report.html` beside a plan that stands, where there is time for it."""
        self._report("report")
        for path, shown in pages_of(plan, self._folder / PAGE).items():
            if path.exists() and not is_page(path):
                self._report(
                    f"{path} isn't of a plan and stays; `plan report -o` writes"
                )
                continue
            try:
                with clock.ticking():
                    error_m = self._errors.get(shown.digest)
                    write_page(
                        shown, path, threads=threads, error_m=error_m, linked=True
                    )
            except TIME_IS_UP:
                word = shell_word(path.parent)
                self._report(f"no time for {path}: `plan report {word}` writes it")

    def finish(self, plan: RigPlan, clock: Stopwatch) -> RigPlan:
        """Save how a run ended, and return the plan that stands in the folder.

        Raises:
            TimeLimitError: If the time limit came first, and none stands.
        """
        # The work is done: a second Ctrl-C must not lose it.
        with suppress(KeyboardInterrupt), uninterrupted():
            if self.last is not None and self.last.digest == plan.digest:
                plan.save(self._folder / "plan.json")
                return plan
            try:
                with clock.ticking():
                    self._save(plan)
            except TimeLimitError:
                if self.last is None:
                    raise
        return self.last or plan

    def _save(self, plan: RigPlan) -> None:
        with ExitStack() as quiet:
            with exchanged(self._folder) as fresh:
                plan.save(fresh / "plan.json")
                self._report("drawing")
                picture = draw_rig(plan, face_status=face_status(plan))
                save_picture(picture, fresh / "rig.png", plan.digest)
                if self._patterns and not plan.cameras_alone:
                    write_patterns(Scanner.of(plan), fresh)
                # No cut between what stands there and what is known of it.
                quiet.enter_context(untimed())
            self.last = plan
