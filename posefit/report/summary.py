"""The sentences of a report's first screen: the leader, and how certain that is."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from posefit.reading import counted
from posefit.report.contest import Contest, is_random
from posefit.statistics.ranks import LEVEL
from posefit.tracking.measures import BASELINES

NAMED = 4  # names that a sentence lists; of more it gives the number

Rows = Sequence[Mapping[str, Any]]
Tests = Mapping[str, Any] | None  # of `paired_tests`; None where there are too few methods or blocks


def leader_sentence(contest: Contest, board: Rows, baselines: Rows, tests: Tests) -> str:
    """Return the first sentences of a report, given the leaderboard, the baselines' rows and the paired tests.

    The leader has the lowest interquartile mean of errors, or the highest share of targets. Another method is *not
    shown to be worse* if Wilcoxon's signed ranks over paired runs have a p of at least 0.05 after Holm.
    """
    first, alone = board[0], len(contest.methods) == 1
    searches = contest.runs.is_search
    unit, digits, name, paired = (" %", 1, "reached", "instances") if searches else ("°", 2, "error", "runs")
    score = f"{first[name]:.{digits}f}{unit}"
    score = f"{score} of all targets reached" if searches else f"an error of {score}"
    if first["low"] is not None and np.isfinite(first["low"]):
        score += f" (95 % interval {first['low']:.{digits}f}{unit} to {first['high']:.{digits}f}{unit})"
    ahead = "" if alone or searches else _ahead(board)
    where = _problems(contest) if searches else _motions(contest)
    others = "; no other method shares its runs"
    if not alone:
        others = others_clause(contest.runs.methods, first["method"], tests, paired)
    sentence = f"{first['name']} {'has' if alone else 'leads with'} {score}{ahead} on {where}{others}."
    if searches:
        if is_random(contest.runs, first["method"]):
            return f"{sentence} That is random search: no method does better."
        return sentence + "".join(f" Random search reached {row['reached']:.1f} %." for row in baselines)
    compared = [row for row in board if row["method"] in contest.methods]
    close = {*(row["method"] for row in compared[:2]), *not_worse(tests, first["method"])}
    rows = [row for row in compared if row["method"] in close]
    return sentence + _lost_sentence(contest, rows[:NAMED]) + _baseline_sentence(first, baselines)


def _motions(contest: Contest) -> str:
    motions = sorted({str(place["motion"]) for place in contest.places()})
    names = listed(motions) if len(motions) <= NAMED else f"{len(motions)} motions"
    return f"{counted(len(contest.instances), 'instance')} of {names} with {_seeds(contest)}"


def _problems(contest: Contest) -> str:
    places = contest.places()
    functions, dimensions = (sorted({place[name] for place in places}) for name in ("function", "dimension"))
    instances = counted(len({(place["function"], place["instance"]) for place in places}), "instance")
    noun = "function" if len(functions) == 1 else "functions"
    return f"{noun} {_series(functions)} in {_series(dimensions)} dimensions, {instances} in all with {_seeds(contest)}"


def _seeds(contest: Contest) -> str:
    seeds = contest.rows.shape[2]
    return "one seed" if seeds == 1 else f"{seeds} seeds each"


def _ahead(board: Rows) -> str:
    """Return by how much the first of a leaderboard is ahead of the second, with the table's digits."""
    first, second = (round(float(row["error"]), 2) for row in board[:2])
    return f", {second - first:.2f}° ahead of {board[1]['name']},"


def _lost_sentence(contest: Contest, rows: Rows) -> str:
    """Return how many of all compared tracks of some methods lost frames; "" if none did."""
    lost = contest.runs.figures["lost"][contest.blocks] > 0.0
    counts = {row["name"]: int(lost[contest.methods.index(row["method"])].sum()) for row in rows}
    by = _series([f"{name} in {count}" for name, count in counts.items()])
    return f" Frames are lost by {by} of {counted(lost[0].size, 'track')}." if any(counts.values()) else ""


def _baseline_sentence(first: Mapping[str, Any], baselines: Rows) -> str:
    """Return the best baseline; "" if there is none."""
    known = [row for row in baselines if row["error"] is not None]
    if not known:
        return ""
    best = min(known, key=lambda row: float(row["error"]))
    text = f"best baseline, the {BASELINES[best['baseline']]}, has {best['error']:.2f}°."
    return f" The {text}" if best["error"] > first["error"] else f" It does not beat the baselines: the {text}"


def others_clause(names: Sequence[str], method: int, tests: Tests, paired: str) -> str:
    """Return how all other methods compare with the leader, from a semicolon on.

    `names` are those of methods by their numbers; `paired` is what was paired, such as "runs".
    """
    if tests is None:
        return f"; one shared {paired[:-1]} is too few to distinguish it from any other method"
    same, worse, better = ([names[m] for m in side] for side in _sides(tests, method))
    blocks = f"{tests['blocks']} paired {paired}"
    # the least p, after Holm, that so few blocks can give the first of so many pairs: m 2 / 2^n
    least_p = min(1.0, float(len(tests["pairs"]) * 2.0 ** (1 - tests["blocks"])))
    if least_p >= LEVEL and all(adjusted >= LEVEL for _, _, _, _, adjusted, *_ in tests["pairs"]):
        return (
            f"; too few {paired} to show any difference (over {blocks} Wilcoxon's p cannot be below {least_p:.2g} "
            f"after Holm over {counted(len(tests['pairs']), 'pair')}, and must be below 0.05)"
        )
    clause = "; all others differ"
    if same:
        clause = f"; {listed(same)} {_are(same)} not shown to be worse"
    if better:
        clause += f", and on most {paired} {listed(better)} {_are(better)} better"
    if worse and (same or better):
        named = listed(worse) if len(worse) <= NAMED else counted(len(worse), "other")
        clause += f", and {named} {_are(worse)} worse"
    elif worse:
        clause = "; every other method is worse"
    return f"{clause} (Wilcoxon's signed ranks over {blocks}, after Holm, at 5 %)"


def not_worse(tests: Tests, method: int) -> list[int]:
    """Return the methods that no paired test distinguishes from one; none where there are no tests."""
    return [] if tests is None else _sides(tests, method)[0]


def _sides(tests: Mapping[str, Any], method: int) -> tuple[list[int], list[int], list[int]]:
    """Return the methods that do not differ significantly from one, those that are worse, and those that are better."""
    place = tests["methods"].index(method)
    same: list[int] = []
    worse: list[int] = []
    better: list[int] = []
    for first, second, difference, _, adjusted, *_ in tests["pairs"]:
        if place in (first, second):
            ahead = (difference if first == place else -difference) < 0.0
            side = same if adjusted >= LEVEL else worse if ahead else better
            side.append(tests["methods"][second if first == place else first])
    return same, worse, better


def three_tracks(contest: Contest, method: int) -> list[tuple[str, int]]:
    """Return the rows of a method's best, median and worst run by error, with these names; fewer of fewer runs."""
    rows = contest.rows[contest.methods.index(method)].ravel()
    ranked = rows[np.argsort(contest.runs.figures["error"][rows], kind="stable")].tolist()
    tracks = [("best", ranked[0]), ("median", ranked[(len(ranked) - 1) // 2]), ("worst", ranked[-1])]
    return tracks[:1] if len(ranked) == 1 else tracks[::2] if len(ranked) == 2 else tracks  # two have no median


def unpaired_sentence(contest: Contest) -> str:
    """Return how many finished runs are compared with nothing or count in no mean; "" if there are none.

    Some method has not finished the instance and seed of those left out. All methods have finished all `blocks`, but
    means use only the seeds that every instance has; tests count the others too.
    """
    spare, seeds = contest.blocks.size - contest.rows.size, contest.rows.shape[2]
    clauses = []
    if contest.left_out:
        has, them = ("run is", "it") if contest.left_out == 1 else ("runs are", "them")
        clauses.append(
            f"{contest.left_out} finished {has} left out of the comparison, "
            f"as some method has no run to pair {them} with"
        )
    if spare:
        where = "count in no figure" if contest.runs.is_search else "count in tests, but not in means and intervals"
        each = "one seed" if seeds == 1 else f"{seeds} seeds"
        clauses.append(f"{spare} {'more ' if clauses else ''}{where}, which are of {each} of every instance")
    return "; ".join(clauses)


def listed(names: Sequence[str]) -> str:
    """Return names as a sentence lists them; of many the first and how many others."""
    if len(names) > NAMED:
        return f"{', '.join(names[: NAMED - 1])} and {len(names) - NAMED + 1} others"
    return _series(names)


def _series(values: Sequence[Any]) -> str:
    texts = [str(value) for value in values]
    return " and ".join(filter(None, [", ".join(texts[:-1]), texts[-1]]))


def _are(names: Sequence[str]) -> str:
    return "is" if len(names) == 1 else "are"
