"""Who reaches most targets, who is not shown to be worse, on what, and how sure that is: in one sentence."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from posefit.report.answer.lead import leads, others_said, so_many
from posefit.report.search.match import Match, is_random

Rows = Sequence[Mapping[str, Any]]


def search_sentence(match: Match, board: Rows, bases: Rows, tests: Mapping[str, Any] | None) -> str:
    """Return what a report of single searches says first, a sentence or two.

    `board` is the leaderboard, best first, `bases` what random search reached, and `tests` the paired tests; None where
    there are too few methods or instances for any. Whoever leads has reached the highest share of targets.
    """
    first = board[0]
    told = _others(match, first, tests)
    sure = ""
    if np.isfinite(first["low"]):
        sure = f" (95 % interval {first['low']:.1f} % to {first['high']:.1f} %)"
    share = f"{first['reached']:.1f} % of all targets reached{sure}"
    said = f"{first['name']} {leads(match.methods)} {share} on {_where(match)}{told}."
    if is_random(match.searches, first["method"]):
        return f"{said} That is random search: nobody does better."
    return said + "".join(f" Random search reached {row['reached']:.1f} %." for row in bases)


def _where(match: Match) -> str:
    """Return on what methods are compared, in words."""
    functions = sorted({function for function, *_ in match.problems})
    dimensions = sorted({dimension for _, dimension, *_ in match.problems})
    instances = {(function, instance) for function, _, instance, _ in match.problems}
    seeds = match.shared.rows.shape[2]
    on = "function" if len(functions) == 1 else "functions"
    return (
        f"{on} {_series(functions)} in {_series(dimensions)} dimensions, {so_many(len(instances), 'instance')} in all "
        f"with {'one seed' if seeds == 1 else f'{seeds} seeds each'}"
    )


def _series(numbers: Sequence[int]) -> str:
    """Return all of some numbers, as a sentence has them."""
    texts = [str(number) for number in numbers]
    return " and ".join(filter(None, [", ".join(texts[:-1]), texts[-1]]))


def _others(match: Match, first: Mapping[str, Any], tests: Mapping[str, Any] | None) -> str:
    if len(match.methods) == 1:
        return "; no other method shares its runs"
    return others_said(match.searches.methods, first["method"], tests, "instances")
