"""`plan reconstruct`: its options, and which exclude each other."""

from pathlib import Path
from typing import Any

import click

from planning.cli.console import (
    Finite,
    PlanFile,
    Positive,
    output_options,
    panel_size,
    run,
    signed_limits,
    threads_option,
)

_DENSE_ONLY = ("projector_size", "code_step", "unit")


@click.command()
@click.argument(
    "plan_file",
    type=PlanFile(),
    metavar="[DIR[/plan.json]]",
    required=False,
)
@click.option(
    "--experiment",
    type=click.Choice(["box", "face"]),
    help="Instead of a plan: an experiment of the paper's section VII, with its truth.",
)
@click.option(
    "--light",
    type=click.Choice(["diverging", "parallel"]),
    help="Of the experiment [default: parallel, as the paper assumes].",
)
@click.option(
    "--variant",
    type=click.Choice(["printed", "fits"]),
    help="Of the experiment: the paper's focal length and image centre, or a lens that "
    "sees all rings [default: printed].",
)
@click.option(
    "--ambient",
    type=Finite(0.0, 10.0),
    metavar="A",
    help="Room light as a share of the projector's [default: what the plan's check "
    "assumes; of an experiment 0].",
)
@click.option(
    "--distortion",
    type=Finite(-0.5, 0.5),
    metavar="K1",
    help="Of the experiment: k1 of the cameras' lenses [default: 0].",
)
@click.option(
    "--second-sequence",
    is_flag=True,
    help="Measure again, with as many rings where the first ones leave most error.",
)
@click.option(
    "--single-shot",
    is_flag=True,
    help="Simulate one image of each camera under each projector; rings are told apart "
    "by a prior mesh: the plan's, or one that is off.",
)
@click.option(
    "--prior-mm",
    type=Positive(),
    metavar="MM",
    help="With --single-shot: how near the object lies to the prior [default: 1; of an "
    "experiment 6, its prior 5 mm off].",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Where cloud.ply goes [default: the plan's folder].",
)
@click.option(
    "--captures",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Read images that cameras took, FOLDER/C1/P1/00-white.png and so on, instead "
    "of simulating them; with --dense those of one camera, FOLDER/*.png.",
)
@click.option(
    "--dense",
    is_flag=True,
    help="Instead of a plan: images of OpenCV's Gray code by one camera and one "
    "projector, --calibration being OpenCV's of both.",
)
@click.option(
    "--projector-size",
    callback=panel_size,
    metavar="WIDTHxHEIGHT",
    help="With --dense: pixels that were coded [default: 1024x768].",
)
@click.option(
    "--code-step",
    type=click.IntRange(1, 64),
    metavar="N",
    help="With --dense: pixels of the projector for one of the code [default: 1].",
)
@click.option(
    "--unit",
    type=click.Choice(["mm", "cm", "m", "in", "um"]),
    help="With --dense: of the calibration's translation, and the cloud [default: mm].",
)
@click.option(
    "--save-captures",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Write the simulated images there, as --captures reads them.",
)
@click.option(
    "--calibration",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Poses and optics as measured after mounting [default: the plan's]; with "
    "--dense OpenCV's FileStorage, XML or YAML.",
)
@click.option(
    "--refine",
    is_flag=True,
    help="Adjust all poses and focal lengths over the edges of all pairs before clouds "
    "are merged, from what [calibration] or mounting leaves; write refined.json.",
)
@click.option(
    "--truth",
    type=PlanFile(),
    metavar="DIR[/plan.json]",
    help="Simulate with what really stands there: another plan, devices matched by id.",
)
@click.option(
    "--align",
    type=click.Choice(["none", "best-fit"]),
    help="Of deviation.ply, which says where captured points deviate from the mesh: as "
    "they were measured, or moved onto it as a rigid body [default: best-fit].",
)
@click.option(
    "--deviation-limits",
    callback=signed_limits,
    metavar="MM|LOW,HIGH",
    help="What points may deviate by, in mm: ends of the colour scale of "
    "deviation.ply, and each region's share outside.",
)
@click.option(
    "--seed", type=click.IntRange(0), help="Of samples and noise [default: the plan's]."
)
@threads_option
@output_options
def reconstruct(**options: Any) -> None:  # noqa: ANN401
    """Measure the object from images, rendered or captured; write cloud.ply."""
    _check_reconstruct(options)
    if options["experiment"] is not None:
        from planning.cli.experiment_command import experiment_command

        run(lambda: experiment_command(options), debug=options["debug"])
    if options["dense"]:
        from planning.cli.devices.gray_command import gray_command

        run(lambda: gray_command(options), debug=options["debug"])
    from planning.cli.checks.reconstruct_command import reconstruct_command

    if options["captures"] is not None and options["save_captures"] is not None:
        raise click.UsageError(
            "give --captures or --save-captures, not both: the one reads images, the "
            "other writes simulated ones"
        )
    run(lambda: reconstruct_command(options), debug=options["debug"])


def _is_set(options: dict[str, Any], name: str) -> bool:
    # A number that is 0 is given, and equal to False.
    return options[name] is not None and options[name] is not False


def _check_dense(options: dict[str, Any]) -> None:
    if options["captures"] is None or options["calibration"] is None:
        raise click.UsageError("--dense goes with --captures FOLDER --calibration FILE")
    known = {"dense", "captures", "calibration", "output", *_DENSE_ONLY}
    known |= {"debug", "quiet", "as_json", "threads"}
    for name in options:
        if name not in known and _is_set(options, name):
            what = "a plan" if name == "plan_file" else f"--{name.replace('_', '-')}"
            raise click.UsageError(
                f"give --dense or {what}, not both: with it nothing is planned, "
                f"simulated or judged"
            )


def _check_reconstruct(options: dict[str, Any]) -> None:
    experiment = options["experiment"] is not None
    if options["dense"]:
        return _check_dense(options)
    for name in _DENSE_ONLY:
        if _is_set(options, name):
            raise click.UsageError(f"--{name.replace('_', '-')} goes with --dense")
    if experiment == (options["plan_file"] is not None):
        raise click.UsageError("give DIR/plan.json, or --experiment box or face")
    if not options["single_shot"] and options["prior_mm"] is not None:
        raise click.UsageError("--prior-mm goes with --single-shot")
    plan_only = (
        "captures",
        "save_captures",
        "calibration",
        "align",
        "deviation_limits",
        "refine",
        "truth",
    )
    experiment_only = ("light", "variant", "distortion")
    for name in plan_only if experiment else experiment_only:
        if _is_set(options, name):
            kind = "an experiment" if experiment else "a plan"
            raise click.UsageError(
                f"--{name.replace('_', '-')} doesn't go with {kind}: it is of "
                f"{'plans' if experiment else 'experiments'}"
            )
    folders = ("captures", "save_captures")
    for first, others, why in (
        (
            "single_shot",
            (*folders, "calibration", "second_sequence", "refine", "truth"),
            "it is of coded sequences",
        ),
        ("second_sequence", folders, "a folder holds one sequence"),
        ("second_sequence", ("refine", "truth"), "each has rings of its own"),
        ("truth", ("captures",), "images that were taken show it"),
        ("ambient", folders[:1], "images that were taken have their own"),
    ):
        for name in others:
            if _is_set(options, first) and _is_set(options, name):
                one, other = (f"--{each.replace('_', '-')}" for each in (first, name))
                raise click.UsageError(f"give {one} or {other}, not both: {why}")
