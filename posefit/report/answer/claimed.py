"""How the orders of methods came out in a sweep that publications claim."""

from collections.abc import Iterable
from typing import Any

from posefit.hooks import ClaimedOrder
from posefit.report.contest import Contest, middle
from posefit.statistics.ranks import LEVEL, wilcoxon


def claim_results(contest: Contest, orders: Iterable[ClaimedOrder]) -> list[dict[str, Any]]:
    """Return how each order came out whose methods all take part, with at least two runs each.

    Each step from a method to the next has a paired test, Holm's over all steps: on instances with their seeds
    (`adjusted`), and on instances alone, each by the mean over its seeds (`by_instance`). A step is `seen` where the
    next method is better in the former at 5 %; a `difference` above 0, in degrees, is in its favour.
    """
    found = [_result(contest, order) for order in orders]
    return [one for one in found if one is not None]


def _result(contest: Contest, order: ClaimedOrder) -> dict[str, Any] | None:
    known = [contest.runs.variants[m]["method"] for m in contest.methods]
    if not all(name in known for name in order.methods):
        return None
    chosen = [known.index(name) for name in order.methods]
    errors, tested = contest.of("error")[chosen], contest.errors_of_blocks()[chosen]
    if tested[0].size < 2:
        return None
    steps = [(k, k + 1) for k in range(len(chosen) - 1)]
    by_instance = wilcoxon(errors.mean(axis=2, keepdims=True), steps)
    return {
        "source": order.source,
        "said": order.statement,
        "methods": [contest.methods[m] for m in chosen],
        "errors": [middle(one.ravel()) for one in errors],
        "steps": [
            {
                "difference": one.difference,
                "p": one.p_value,
                "adjusted": one.adjusted,
                "by_instance": other.adjusted,
                "seen": one.difference > 0.0 and one.adjusted < LEVEL,
            }
            for one, other in zip(wilcoxon(tested, steps), by_instance, strict=True)
        ],
        "blocks": tested[0].size,
        "instances": errors.shape[1],
    }
