"""How many devices, and what is proved of fewer: lines of a brief result."""

from collections.abc import Iterator

from planning.model.document.certificates import Certificate
from planning.model.plan import RigPlan
from planning.model.words import count_words
from planning.report.tolerance.survival_lines import counted_words

from .devices.device_lines import used_up
from .devices.station_lines import fewest_words
from .family_lines import family_bounds

# Label, text, and the lines that it takes at most.
Block = tuple[str, str, int]


def fewest(plan: RigPlan) -> Iterator[Block]:
    """Say what is known of fewer devices, over the candidates and over every pose."""
    if plan.document.evaluation is not None:
        return
    if plan.members:
        for label, words in zip(("FEWEST", ""), family_bounds(plan), strict=True):
            yield label, words, 2
        return
    if fewest := fewest_words(plan):
        yield "FEWEST", fewest, 2
        return
    proofs = plan.document.certificates
    kinds = {"camera": proofs.cameras}
    if proofs.projectors is not None:
        kinds = {"projector": proofs.projectors, **kinds}
    if plan.document.survival is not None:
        yield from zip(("FEWEST", ""), counted_words(plan), (2, 2), strict=True)
        return
    if len(kinds) > 1 and all(_over_all(proof) for proof in kinds.values()):
        counts = [count_words(proof.count, kind) for kind, proof in kinds.items()]
        held = {proof.candidates.status for proof in kinds.values()}
        over = "proved over candidates and over every pose"
        if held != {"proved"}:
            over = "proved over every pose"
        yield "FEWEST", f"{counts[0]} and, given these, {counts[1]}: {over}", 2
        return
    for label, (kind, proof) in zip(("FEWEST", ""), kinds.items(), strict=False):
        yield label, _proved(kind, proof, used_up(plan.document, kind)), 2


def _over_all(proof: Certificate) -> bool:
    bound = proof.continuous
    return (
        proof.status == "optimal"
        and proof.needed.count <= proof.count
        and bound is not None
        and bound.lower_bound >= proof.count
    )


def _proved(kind: str, proof: Certificate, gone: str) -> str:
    needed, least = proof.needed, proof.candidates.lower_bound
    status, count = proof.candidates.status, count_words(proof.count, kind)
    over = f"{status} over the candidates"
    if needed.count > proof.count:
        words = f"at least {needed.lower_bound} {kind}s {over}, "
        most = f"no more of {gone} in stock"
        most = most if gone else f"at most {proof.count} was asked"
        return f"{words}{needed.count} suffice; {most}"
    if proof.status != "optimal":
        return f"{count}; at least {least} {_are(least)} needed, {over}"
    if proof.continuous is None:
        return f"{count}: {over}; nothing is proved over every pose"
    if _over_all(proof):
        return f"{count}: {over}, proved over every pose in the workspace"
    least = proof.continuous.lower_bound
    return f"{count}: {over}; over every pose at least {least} {_are(least)} needed"


def _are(count: int) -> str:
    return "is" if count == 1 else "are"
