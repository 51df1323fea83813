"""What of a stock of several models is used up."""

from collections import Counter

from planning.model.document.plan_document import PlanDocument


def used_up(document: PlanDocument, kind: str) -> str:
    """Return which counted models of a `projector` or a `camera` none is left of.

    Empty where some are, or there is one model.
    """
    stock = document.requirements.stock_of(kind)
    taken = Counter(record.model for record in getattr(document, f"{kind}s"))
    gone = [f"{model} ({n})" for model, n in stock.items() if taken[model] >= n]
    return " and ".join(gone)


def models_line(document: PlanDocument) -> str:
    """Return which device is of which of several models; empty of one."""
    of_models: dict[str, list[str]] = {}
    for record in (*document.projectors, *document.cameras):
        if record.model:
            of_models.setdefault(record.model, []).append(record.id)
    return "; ".join(f"{', '.join(ids)}: {of}" for of, ids in of_models.items())
