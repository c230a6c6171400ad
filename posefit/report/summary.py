"""The sentences of a report's first screen: what leads, by how much, and how certain that is."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from posefit.errors import printable
from posefit.reading import counted
from posefit.report.columns import listed
from posefit.report.kind import Contest
from posefit.statistics.ranks import LEVEL

Row = Mapping[str, Any]


def leader_sentences(
    contest: Contest, board: Sequence[Row], baselines: Sequence[Row]
) -> list[str]:
    """Return the sentences of a report, given the leaderboard and the baselines' rows.

    The first says what leads, the next ones by how much and how certain that is: the median of paired differences, and
    p of Wilcoxon's signed ranks after Holm, which below 0.05 shows a difference.
    """
    first, *others = (row for row in board if row["taking_part"])
    kind = contest.runs.kind
    score = kind.score
    seeds = contest.rows.shape[2]
    value = score.sentence.format(score.text(first[score.name]))
    if first["low"] is not None and np.isfinite(first["low"]):
        value += f" (95 % interval {score.text(first['low'])} to {score.text(first['high'])})"
    where = f"{kind.place_words(contest)} with {'one seed' if seeds == 1 else f'{seeds} seeds each'}"
    sentences = [
        f"{first['name']} {'leads with' if others else 'has'} {value} on {where}.",
        *_certainty(contest, others),
        *kind.baseline_sentences(first, baselines),
    ]
    return [*map(printable, sentences)]


def _certainty(contest: Contest, others: Sequence[Row]) -> list[str]:
    """Return how the other methods compare with the leader, those that differ from it first."""
    score = contest.runs.kind.score
    count = len(contest.comparisons)
    if not others:
        return ["No other method shares its runs."]
    if not count:
        return [
            f"One shared {score.paired[:-1]} is too few to distinguish it from any other method."
        ]
    blocks = contest.tested_errors()[0].size

    def effect(row: Row) -> str:
        """Return by how much a method is behind, and the p."""
        p = "p < 0.001" if row["p"] < 0.001 else f"p = {row['p']:.2g}"
        behind = f"{row['behind']:+z.{score.digits}f}".replace("-", "−")
        return f"{row['name']} (median difference {behind}{score.points}, {p})"

    # the least p, after Holm, that so few blocks can give the first of so many pairs: m 2 / 2^n
    least_p = min(1.0, float(count * 2.0 ** (1 - blocks)))
    unclear = [row for row in others if row["p"] is None or row["p"] >= LEVEL]
    worse, better = (
        [row for row in others if row not in unclear and sign * row["behind"] > 0]
        for sign in (1, -1)
    )
    over = f"{blocks:,} paired {score.paired}"
    sentences = []
    if len(worse) == len(others):
        sentences.append(
            f"Over {over} every other method is worse, the next one is {effect(worse[0])}."
        )
    elif worse:
        sentences.append(
            f"Over {over} it is better than {listed([row['name'] for row in worse])}."
        )
    if better:
        sentences.append(
            f"On most {score.paired} it is worse than {listed([*map(effect, better)])}."
        )
    if unclear:
        sentences.append(
            f"{over} are too few to tell it from {listed([*map(effect, unclear)])}."
        )
    if least_p >= LEVEL:
        pairs = counted(count, "pair")
        sentences.append(
            f"So few cannot show any difference: of {pairs} of methods no p can be below {least_p:.2g}."
        )
    return sentences


def unpaired_sentence(contest: Contest) -> str:
    """Return how many finished runs are compared with nothing or count in no mean; "" if there are none.

    Some method has not finished the instance and seed of those left out. All methods have finished all `blocks`, but
    means use only the seeds that every instance has; tests count the others too.
    """
    spare = contest.blocks.size - contest.rows.size
    seeds = contest.rows.shape[2]
    clauses = []
    if contest.left_out:
        has, them = ("run is", "it") if contest.left_out == 1 else ("runs are", "them")
        clauses.append(
            f"{contest.left_out} finished {has} left out of the comparison, "
            f"as some method has no run to pair {them} with"
        )
    if spare:
        tested = contest.tested_errors()[0].size == contest.blocks.shape[1]
        where = (
            "count in tests, but not in means and intervals"
            if tested
            else "count in no figure"
        )
        each = "one seed" if seeds == 1 else f"{seeds} seeds"
        clauses.append(
            f"{spare} {'more ' if clauses else ''}{where}, which are of {each} of every instance"
        )
    return "; ".join(clauses)
