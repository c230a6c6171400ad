"""The sentences of a report's first screen: the leader, how certain that is, and published claims."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from posefit.hooks import ClaimedOrder
from posefit.report.contest import Contest, interquartile_mean, is_random
from posefit.statistics.ranks import LEVEL, wilcoxon
from posefit.tracking.measures import BASELINES

NAMED = 4  # names that a sentence lists; of more it gives the number
EXAMPLES = ("best", "median", "worst")  # tracks of the leader, in this order

Rows = Sequence[Mapping[str, Any]]
Tests = Mapping[str, Any] | None  # of `paired_tests`; None where there are too few methods or blocks


def leader_sentence(contest: Contest, board: Rows, baselines: Rows, tests: Tests) -> str:
    """Return the first sentences of a report, given the leaderboard, the baselines' rows and the paired tests.

    The leader has the lowest interquartile mean of errors, or the highest share of targets. Another method is *not
    shown to be worse* if Wilcoxon's signed ranks over paired runs have a p of at least 0.05 after Holm.
    """
    first, alone = board[0], len(contest.methods) == 1
    unit, digits, name = (" %", 1, "reached") if contest.runs.is_search else ("°", 2, "error")
    interval = ""
    if first["low"] is not None and np.isfinite(first["low"]):
        interval = f" (95 % interval {first['low']:.{digits}f}{unit} to {first['high']:.{digits}f}{unit})"
    value = f"{first[name]:.{digits}f}{unit}"
    score = f"{value} of all targets reached{interval}" if contest.runs.is_search else f"an error of {value}{interval}"
    if contest.runs.is_search:
        ahead, where, paired = "", _problems(contest), "instances"
    else:
        ahead, where, paired = "" if alone else _ahead(board), _motions(contest), "runs"
    others = "; no other method shares its runs"
    if not alone:
        others = others_clause(contest.runs.methods, first["method"], tests, paired)
    sentence = f"{first['name']} {'has' if alone else 'leads with'} {score}{ahead} on {where}{others}."
    if contest.runs.is_search:
        return sentence + _random_sentence(contest, first, baselines)
    return (
        sentence + _lost_sentence(contest, board[: min(2, len(contest.methods))]) + _baseline_sentence(first, baselines)
    )


def _motions(contest: Contest) -> str:
    """Return the instances of tracks in words."""
    _, instances, seeds = contest.rows.shape
    motions = sorted({str(contest.runs.places[i]["motion"]) for i in contest.instances})
    of = listed(motions) if len(motions) <= NAMED else f"{len(motions)} motions"
    return f"{counted(instances, 'instance')} of {of} with {'one seed' if seeds == 1 else f'{seeds} seeds each'}"


def _problems(contest: Contest) -> str:
    """Return the problems of single searches in words."""
    places = [contest.runs.places[i] for i in contest.instances]
    functions, dimensions = (sorted({place[name] for place in places}) for name in ("function", "dimension"))
    instances = {(place["function"], place["instance"]) for place in places}
    seeds = contest.rows.shape[2]
    noun = "function" if len(functions) == 1 else "functions"
    return (
        f"{noun} {_series(functions)} in {_series(dimensions)} dimensions, "
        f"{counted(len(instances), 'instance')} in all with {'one seed' if seeds == 1 else f'{seeds} seeds each'}"
    )


def _ahead(board: Rows) -> str:
    """Return by how much the first of a leaderboard is ahead of the second, with the table's digits."""
    first, second = (round(float(row["error"]), 2) for row in board[:2])
    return f", {second - first:.2f}° ahead of {board[1]['name']},"


def _lost_sentence(contest: Contest, rows: Rows) -> str:
    """Return how many of all compared tracks of the first methods lost frames; "" if none did."""
    lost = contest.runs.figures["lost"][contest.blocks] > 0.0
    counts = [(row["name"], int(lost[contest.methods.index(row["method"])].sum())) for row in rows]
    if not any(count for _, count in counts):
        return ""
    by = " and ".join(f"{name} in {count}" for name, count in counts)
    return f" Frames are lost by {by} of {counted(lost[0].size, 'track')}."


def _baseline_sentence(first: Mapping[str, Any], baselines: Rows) -> str:
    """Return the best baseline; "" if there is none."""
    known = [row for row in baselines if row["error"] is not None]
    if not known:
        return ""
    best = min(known, key=lambda row: float(row["error"]))
    text = f"the best baseline, the {BASELINES[best['baseline']]}, has {best['error']:.2f}°"
    if best["error"] > first["error"]:
        return f" {text[0].upper()}{text[1:]}."
    return f" It does not beat the baselines: {text}."


def _random_sentence(contest: Contest, first: Mapping[str, Any], baselines: Rows) -> str:
    if is_random(contest.runs, first["method"]):
        return " That is random search: no method does better."
    return "".join(f" Random search reached {row['reached']:.1f} %." for row in baselines)


def others_clause(names: Sequence[str], method: int, tests: Tests, paired: str) -> str:
    """Return how all other methods compare with the leader, from a semicolon on.

    `names` are those of methods by their numbers; `paired` is what was paired, such as "runs".
    """
    if tests is None:
        return f"; one shared {paired[:-1]} is too few to distinguish it from any other method"
    same, worse, better = ([names[m] for m in side] for side in _sides(tests, method))
    if too_few(tests):
        pairs = counted(len(tests["pairs"]), "pair")
        return (
            f"; too few {paired} to show any difference (over {tests['blocks']} paired {paired} Wilcoxon's p cannot be "
            f"below {least_p(tests):.2g} after Holm over {pairs}, and must be below 0.05)"
        )
    clause = "; all others differ"
    if same:
        clause = f"; {listed(same)} {_are(same)} not shown to be worse"
    if better:
        clause += f", and on most {paired} {listed(better)} {_are(better)} better"
    if worse and (same or better):
        clause += f", and {counted(len(worse), 'other')} {_are(worse)} worse"
    elif worse:
        clause = "; every other method is worse"
    return f"{clause} (Wilcoxon's signed ranks over {tests['blocks']} paired {paired}, after Holm, at 5 %)"


def not_worse(tests: Tests, method: int) -> list[int]:
    """Return the methods that no paired test distinguishes from one; none where there are no tests."""
    return [] if tests is None else _sides(tests, method)[0]


def least_p(tests: Mapping[str, Any]) -> float:
    """Return the least p, after Holm, that so few blocks can give the first of so many pairs: m 2 / 2^n, at most 1."""
    return min(1.0, float(len(tests["pairs"]) * 2.0 ** (1 - tests["blocks"])))


def too_few(tests: Mapping[str, Any]) -> bool:
    """Return whether there are too few blocks to show a difference between any two methods, however large."""
    return least_p(tests) >= LEVEL and all(adjusted >= LEVEL for _, _, _, _, adjusted, *_ in tests["pairs"])


def _sides(tests: Mapping[str, Any], method: int) -> tuple[list[int], list[int], list[int]]:
    """Return the methods that do not differ significantly from one, those that are worse, and those that are better."""
    mine = tests["methods"].index(method)
    same: list[int] = []
    worse: list[int] = []
    better: list[int] = []
    for first, second, difference, _, adjusted, *_ in tests["pairs"]:
        if mine not in (first, second):
            continue
        ahead = (difference if first == mine else -difference) < 0.0
        side = same if adjusted >= LEVEL else worse if ahead else better
        side.append(tests["methods"][second if first == mine else first])
    return same, worse, better


def three_tracks(contest: Contest, method: int) -> list[tuple[str, int]]:
    """Return the rows of a method's best, median and worst run by error, with these names; fewer of fewer runs."""
    rows = contest.rows[contest.methods.index(method)].ravel()
    ranked = rows[np.argsort(contest.runs.figures["error"][rows], kind="stable")].tolist()
    places = dict.fromkeys((0, (len(ranked) - 1) // 2, len(ranked) - 1))
    if len(places) == 2:  # two runs have no median
        return list(zip(EXAMPLES[::2], ranked, strict=True))
    return [(name, ranked[place]) for name, place in zip(EXAMPLES, places, strict=False)]


def unpaired_sentence(unpaired: int, spare: int, seeds: int, *, tested: bool) -> str:
    """Return how many finished runs are compared with nothing or count in no mean; "" if there are none.

    Some method has not finished the instance and seed of `unpaired` runs. All methods have finished those of `spare`
    runs, but means use only the `seeds` that every instance has; tests count them too where they are `tested`.
    """
    clauses = []
    if unpaired:
        has, them = ("run is", "it") if unpaired == 1 else ("runs are", "them")
        clauses.append(
            f"{unpaired} finished {has} left out of the comparison, as some method has no run to pair {them} with"
        )
    if spare:
        where = "count in tests, but not in means and intervals" if tested else "count in no figure"
        each = "one seed" if seeds == 1 else f"{seeds} seeds"
        clauses.append(f"{spare} {'more ' if unpaired else ''}{where}, which are of {each} of every instance")
    return "; ".join(clauses)


def published_claims(contest: Contest, orders: Iterable[ClaimedOrder]) -> list[dict[str, Any]]:
    """Return the result of each published order of methods that all take part, with at least two runs each.

    Each step from a method to the next has a paired test, Holm's over all steps: on instances with their seeds
    (`adjusted`), and on instances alone, each by the mean over its seeds (`by_instance`). A step is `confirmed` if the
    next method is better in the former at 5 %; a `difference` above 0, in degrees, is in its favour.
    """
    known = [contest.runs.variants[m]["method"] for m in contest.methods]
    results = []
    for order in orders:
        if not all(name in known for name in order.methods) or contest.blocks.shape[1] < 2:
            continue
        chosen = [known.index(name) for name in order.methods]
        errors, tested = contest.of("error")[chosen], contest.tested_errors()[chosen]
        steps = [(k, k + 1) for k in range(len(chosen) - 1)]
        by_instance = wilcoxon(errors.mean(axis=2, keepdims=True), steps)
        result = {
            "source": order.source,
            "said": order.statement,
            "methods": [contest.methods[m] for m in chosen],
            "errors": [interquartile_mean(one.ravel()) for one in errors],
            "blocks": tested[0].size,
            "instances": errors.shape[1],
            "steps": [
                {
                    "difference": step.difference,
                    "p": step.p_value,
                    "adjusted": step.adjusted,
                    "by_instance": other.adjusted,
                    "confirmed": step.difference > 0.0 and step.adjusted < LEVEL,
                }
                for step, other in zip(wilcoxon(tested, steps), by_instance, strict=True)
            ],
        }
        results.append(result)
    return results


def listed(names: Sequence[str]) -> str:
    """Return names as a sentence lists them; of many the first and how many others."""
    if len(names) > NAMED:
        return f"{', '.join(names[: NAMED - 1])} and {len(names) - NAMED + 1} others"
    return _series(names)


def _series(values: Sequence[Any]) -> str:
    """Return all values as a sentence lists them."""
    texts = [str(value) for value in values]
    return " and ".join(filter(None, [", ".join(texts[:-1]), texts[-1]]))


def counted(count: int, word: str) -> str:
    """Return a count with its noun: `1 run`, `2,000 runs`."""
    return f"{count:,} {word}" if count == 1 else f"{count:,} {word}s"


def _are(names: Sequence[str]) -> str:
    return "is" if len(names) == 1 else "are"
