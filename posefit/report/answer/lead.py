"""Who leads a sweep, who is not shown to be worse, on what, and how sure that is: in one sentence."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from posefit.report.contest import Contest
from posefit.statistics.ranks import LEVEL
from posefit.tracking.measures import BASELINES

NAMED = 4  # methods of a kind that the sentence names; of more it says how many
EXAMPLES = ("best", "median", "worst")  # tracks of the leader, in this order

Rows = Sequence[Mapping[str, Any]]


def lead_sentence(contest: Contest, board: Rows, bases: Rows, tests: Mapping[str, Any] | None) -> str:
    """Return what a report says first, a sentence or two.

    `board` is the leaderboard, best first, `bases` the baselines' rows, and `tests` the paired tests; None where there
    are too few methods or runs for any. Whoever leads has the lowest interquartile mean of errors; a method that is
    held against no other does not lead. Others are not shown to be worse where Wilcoxon's signed ranks over paired runs
    have a p of 0.05 or more, after Holm.
    """
    _, instances, seeds = contest.rows.shape
    first = board[0]
    error, low, high = first["error"], first["low"], first["high"]
    sure = "" if low is None or not np.isfinite(low) else f" (95 % interval {low:.2f}° to {high:.2f}°)"
    motions = sorted({str(contest.runs.places[i]["motion"]) for i in contest.instances})
    of = f" of {listed(motions)}" if len(motions) <= NAMED else f" of {len(motions)} motions"
    each = "one seed" if seeds == 1 else f"{seeds} seeds each"
    on = f"{so_many(instances, 'instance')}{of} with {each}"
    ahead = "" if len(contest.methods) == 1 else _ahead(board)
    told = _others(contest, first, tests)
    said = f"{first['name']} {leads(contest.methods)} an error of {error:.2f}°{sure}{ahead} on {on}{told}."
    return said + _lost_said(contest, board[: min(2, len(contest.methods))]) + _held_against(error, bases)


def leads(methods: Sequence[int]) -> str:
    """Return what whoever comes first does: alone it leads nobody."""
    return "has" if len(methods) == 1 else "leads with"


def three_tracks(contest: Contest, method: int) -> list[tuple[str, int]]:
    """Return the rows of a method's best, median and worst run by error, with these names; fewer of fewer runs."""
    rows = contest.rows[contest.methods.index(method)].ravel()
    ranked = rows[np.argsort(contest.runs.figures["error"][rows], kind="stable")].tolist()
    places = dict.fromkeys((0, (len(ranked) - 1) // 2, len(ranked) - 1))
    if len(places) == 2:  # of two runs there is no median
        return list(zip(EXAMPLES[::2], ranked, strict=True))
    return [(name, ranked[place]) for name, place in zip(EXAMPLES, places, strict=False)]


def not_told_apart(tests: Mapping[str, Any] | None, method: int) -> list[int]:
    """Return the methods that no paired test tells apart from one; none where there are no tests."""
    return [] if tests is None else _sides(tests, method)[0]


def others_said(names: Sequence[str], method: int, tests: Mapping[str, Any] | None, what: str) -> str:
    """Return what a sentence about the leader says of all other methods, from a semicolon on.

    `names` are those of methods by their numbers, `tests` paired tests of at least two methods, as of `paired_tests`:
    None where there are too few runs for any; `what` is what was paired, such as "runs".
    """
    if tests is None:
        return f"; one shared {what[:-1]} is too few to tell it apart from any other method"
    same, worse, better = ([names[m] for m in side] for side in _sides(tests, method))
    if too_few(tests):
        pairs = so_many(len(tests["pairs"]), "pair")
        return (
            f"; too few {what} to tell any methods apart (over {tests['blocks']} paired {what} Wilcoxon's p cannot be "
            f"below {least_p(tests):.2g} after Holm over {pairs}, and 0.05 is asked for)"
        )
    how = f"(Wilcoxon's signed ranks over {tests['blocks']} paired {what}, after Holm, at 5 %)"
    told = "; every other method can be told apart"
    if same:
        told = f"; {listed(same)} {'is' if len(same) == 1 else 'are'} not shown to be worse"
    if better:
        told += f", and on most {what} {listed(better)} {'is' if len(better) == 1 else 'are'} better"
    if worse and (same or better):
        told += f", and {so_many(len(worse), 'other')} {'is' if len(worse) == 1 else 'are'} worse"
    elif worse:
        told += " and is worse"
    return f"{told} {how}"


def least_p(tests: Mapping[str, Any]) -> float:
    """Return the least p, after Holm, that so few blocks can give the first of so many pairs: m 2 / 2^n, at most 1."""
    return min(1.0, float(len(tests["pairs"]) * 2.0 ** (1 - tests["blocks"])))


def too_few(tests: Mapping[str, Any]) -> bool:
    """Return whether no two methods could have been told apart, however different they are."""
    return least_p(tests) >= LEVEL and all(adjusted >= LEVEL for _, _, _, _, adjusted, *_ in tests["pairs"])


def _ahead(board: Rows) -> str:
    """Return by how much the first of a leaderboard is ahead of the second, as the table's digits have it."""
    first, second = (round(float(row["error"]), 2) for row in board[:2])
    return f", {second - first:.2f}° ahead of {board[1]['name']},"


def _lost_said(contest: Contest, rows: Rows) -> str:
    """Return a sentence of how many of all compared tracks of the first methods lost frames; none where none did."""
    lost = contest.runs.figures["lost"][contest.blocks] > 0.0
    counts = [(row["name"], int(lost[contest.methods.index(row["method"])].sum())) for row in rows]
    if not any(count for _, count in counts):
        return ""
    told = " and ".join(f"{name} in {count}" for name, count in counts)
    return f" Frames are lost by {told} of {so_many(lost[0].size, 'track')}."


def _sides(tests: Mapping[str, Any], method: int) -> tuple[list[int], list[int], list[int]]:
    """Return the methods that are not told apart from one, that are worse, and that are better."""
    mine = tests["methods"].index(method)
    same: list[int] = []
    worse: list[int] = []
    better: list[int] = []
    for one, other, difference, _, adjusted, *_ in tests["pairs"]:
        if mine not in (one, other):
            continue
        ahead = (difference if one == mine else -difference) < 0.0
        side = same if adjusted >= LEVEL else worse if ahead else better
        side.append(tests["methods"][other if one == mine else one])
    return same, worse, better


def _others(contest: Contest, first: Mapping[str, Any], tests: Mapping[str, Any] | None) -> str:
    if len(contest.methods) == 1:
        return "; no other method shares its runs"
    return others_said(contest.runs.methods, first["method"], tests, "runs")


def _held_against(error: float, bases: Rows) -> str:
    """Return a sentence of the strongest baseline, if anybody reaches one."""
    known = [one for one in bases if one["error"] is not None]
    if not known:
        return ""
    best = min(known, key=lambda one: float(one["error"]))
    said = f"the best baseline, the {BASELINES[best['baseline']]}, has {best['error']:.2f}°"
    if best["error"] > error:
        return f" {said[0].upper()}{said[1:]}."
    return f" It does not beat the baselines: {said}."


def listed(names: Sequence[str]) -> str:
    """Return names as a sentence lists them; of many the first and how many others."""
    if len(names) > NAMED:
        return f"{', '.join(names[: NAMED - 1])} and {len(names) - NAMED + 1} others"
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


def so_many(count: int, word: str) -> str:
    """Return so many of something, in words."""
    return f"{count} {word}" if count == 1 else f"{count} {word}s"
