"""What `plan --pareto` does."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import click

from planning.cli.console import print_json, progress, writable
from planning.cli.lines.front_lines import front_csv, front_lines
from planning.model.files import write_together
from planning.report.drawing.front_picture import draw_front
from planning.rig.rig import load_rig
from planning.rig.wishes import Wishes
from planning.steps.front.kept_front import FRONT_FILE, KeptFront
from planning.steps.front.plan_front import plan_front
from planning.steps.stations.carried import pattern_of_rig

from .kept_fronts import front_folder
from .plan_command import read_fixed, read_object, timed

CSV_FILE, PICTURE_FILE = "pareto.csv", "pareto.png"
# Options that are wishes by the same name.
_WISHED = (
    *("max_cameras", "target", "dominant_coverage", "coverage"),
    *("min_reachable", "region_coverage", "accuracy_mm", "accuracy_of", "up"),
    *("ring_axis", "robust", "views", "survive", "joint"),
)


def front_command(options: Mapping[str, Any]) -> int:
    """Make the front, write its files, print it; return the exit code."""
    clock = timed(options, click.get_current_context().obj)
    path = Path(options["ranges"] or options["meshes"][0])
    folder = front_folder(options, path)
    names = CSV_FILE, PICTURE_FILE, FRONT_FILE
    with writable(folder, *names), progress(quiet=options["quiet"]) as report:
        with clock.ticking():
            rig = load_rig(options["rig_name"], light=options["light"])
            fixed = read_fixed(options["fixed"], rig)
            surface, interest = read_object(path, options, rig, report)
        kept = plan_front(
            surface,
            rig,
            Wishes(
                max_projectors=options["max_projectors"] or 0,
                pattern=pattern_of_rig(rig, options["pattern"]),
                **{name: options[name] for name in _WISHED},
            ),
            select=interest,
            fixed=fixed,
            seed=options["seed"],
            threads=options["threads"],
            time_limit=clock.remaining,
            progress=report,
        )
        files = _written(kept, folder)
    front = kept.front
    if options["as_json"]:
        print_json(front.to_document() | {"files": files})
    else:
        click.echo("\n".join(front_lines(front, path.name, files)))
    return 0 if any(point.meets for point in front.points) else 1


def _written(kept: KeptFront, folder: Path) -> list[str]:
    """Write table, picture and matrix, none before all are complete."""
    picture, table = draw_front(kept.front), front_csv(kept.front).encode()
    files: dict[Path, Callable[[BinaryIO], object]] = {
        folder / CSV_FILE: lambda file: file.write(table),
        folder / PICTURE_FILE: lambda file: picture.save(file, format="PNG"),
        folder / FRONT_FILE: kept.write,
    }
    write_together(files)
    return [str(path) for path in files]
