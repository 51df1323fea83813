"""What helps the plan of a front's point: another point, or another front."""

import re
from collections.abc import Sequence

from planning.model.document.plan_document import PlanDocument

# An option that a point leaves no room for, and what no other front is needed for.
_COUNT = re.compile(r"--max-(projector|camera)s (\d+)")
_ACCEPTS = re.compile(r"(accepts?) (this plan|what there is)$")


def of_fronts(
    document: PlanDocument, every: Sequence[tuple[str, ...]]
) -> list[tuple[str, ...]]:
    """Return what helps each shortfall, in options that a plan of `--take` has.

    The point says how many devices there are, and its front was made for what is asked:
    neither can be another beside `--take`.
    """
    if not any(word.split("=")[0] == "--take" for word in document.command):
        return [*every]
    counts = {"projector": len(document.projectors), "camera": len(document.cameras)}
    for kind, count in _COUNT.findall(" ".join(text for one in every for text in one)):
        counts[kind] = max(counts[kind], int(count))
    point = f"--take {counts['projector']},{counts['camera']}"
    return [
        tuple(
            _ACCEPTS.sub(
                r"\1 \2 if the front is made again with it", _COUNT.sub(point, text)
            )
            for text in helps
        )
        for helps in every
    ]
