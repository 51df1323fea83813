"""Every pair of a rig, rendered by Mitsuba as it stands and decoded as believed."""

from planning.verify.reconstruction.decode.decode import Decoded, Pairs, decode
from planning.verify.reconstruction.render.photometry import Photometry
from planning.verify.reconstruction.render.rendered import Progress, Spent
from planning.verify.reconstruction.scanner import Scanner

from .path_traced import PathTracer
from .physics import Physics


def decode_path_traced(
    plan: Scanner,
    truth: Scanner,
    photometry: Photometry,
    *,
    physics: Physics,
    seed: int,
    threads: int,
    spent: Spent,
    progress: Progress | None = None,
) -> Pairs:
    """Render and decode every pair, as `decode_rendered` does with our own renderer.

    Projectors that shine at the same time by mistake are rendered one by one.

    Raises:
        InputError: If Mitsuba isn't installed, or lacks a camera's lens, or the
            pattern is dense.
    """
    plan.require_rings("rendering by Mitsuba")
    pairs, found = dict(plan.pairs()), dict[tuple[int, int], Decoded]()
    names = {camera.id: c for c, camera in enumerate(plan.cameras)}
    with PathTracer(truth, physics, photometry, threads) as tracer:
        for p, projector in enumerate(plan.projectors):
            with spent.on("render"):
                images = tracer.frames(plan, p, seed=seed)
            for camera, frames in images:
                pair = (p, names[camera])
                if pair not in pairs:
                    continue
                patterns = projector.pattern_for(plan.cameras[pair[1]])
                with spent.on("decode"):
                    found[pair] = decode(
                        frames, patterns, pairs[pair], **plan.limits.decoder
                    )
            if progress is not None:
                progress((p + 1) * len(plan.cameras), len(pairs))
    return [(pair, found.get(pair, Decoded.nothing())) for pair in pairs]
