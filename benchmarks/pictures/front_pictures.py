"""The picture of docs/use/pareto.md: the sample's front as the command draws it."""

from PIL import Image

from .job import ROOT, Job, command


def pareto(job: Job) -> Image.Image:
    """What `plan --mesh face.obj --pareto` draws."""
    folder = job.folder / "front"
    mesh = str(ROOT / "face.obj")
    command("--mesh", mesh, "--pareto", "--quiet", "-o", str(folder))
    with Image.open(folder / "pareto.png") as picture:
        return picture.copy()
