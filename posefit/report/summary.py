"""The sentences of a report's first screen: what leads, by how much, and how certain that is."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from posefit.evaluation.measures import BASELINES
from posefit.reading import counted
from posefit.report.contest import Contest, is_random
from posefit.statistics.ranks import LEVEL

NAMED = 4  # names that a sentence lists; of more it gives the number

Row = Mapping[str, Any]


def leader_sentences(contest: Contest, board: Sequence[Row], baselines: Sequence[Row]) -> list[str]:
    """Return the sentences of a report, given the leaderboard and the baselines' rows.

    The first says what leads and by how much, the next ones how certain that is: Wilcoxon's signed ranks over paired
    runs show a difference if p is below 0.05 after Holm.
    """
    first, *others = (row for row in board if row["taking_part"])
    searches, score = contest.runs.is_search, contest.runs.score
    name, digits, unit = score["name"], score["digits"], score["unit"]
    value = f"{first[name]:.{digits}f}{unit}"
    value = f"{value} of all targets reached" if searches else f"an error of {value}"
    if first["low"] is not None and np.isfinite(first["low"]):
        value += f" (95 % interval {first['low']:.{digits}f}{unit} to {first['high']:.{digits}f}{unit})"
    if others:
        lead = abs(round(others[0][name], digits) - round(first[name], digits))
        value += f", {lead:.{digits}f}{score['points']} ahead of {others[0]['name']},"
    where = _problems(contest) if searches else _motions(contest)
    sentences = [f"{first['name']} {'leads with' if others else 'has'} {value} on {where}."]
    sentences += _certainty(contest, others)
    if searches:
        if is_random(contest.runs, first["method"]):
            return [*sentences, "That is random search: no method does better."]
        return [*sentences, *(f"Random search reached {row['reached']:.1f} %." for row in baselines)]
    close = [first, *(row for k, row in enumerate(others) if k == 0 or _is_open(row))]
    return [*sentences, *_lost_sentence(close[:NAMED]), *_baseline_sentence(first, baselines)]


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


def _is_open(row: Row) -> bool:
    """Return whether no test distinguishes a method from the leader."""
    return row["p"] is None or bool(row["p"] >= LEVEL)


def _certainty(contest: Contest, others: Sequence[Row]) -> list[str]:
    """Return how the other methods compare with the leader, those that differ from it first."""
    score, count = contest.runs.score, len(contest.comparisons)
    paired, digits, points = score["paired"], score["digits"], score["points"]
    if not others:
        return ["No other method shares its runs."]
    if not count:
        return [f"One shared {paired[:-1]} is too few to distinguish it from any other method."]
    blocks = contest.tested_errors()[0].size

    def effect(row: Row) -> str:
        """Return by how much a method is behind, with the interval and the p."""
        low, high = (f"{row[end]:+z.{digits}f}" for end in ("behind_low", "behind_high"))
        ends = f", {low} to {high}" if np.isfinite(row["behind_low"]) else ""
        p = "p < 0.001" if row["p"] < 0.001 else f"p = {row['p']:.2g}"
        behind = f"{row['behind']:+z.{digits}f}{points}{ends}".replace("-", "−")
        return f"{row['name']} ({behind}, {p})"

    # the least p, after Holm, that so few blocks can give the first of so many pairs: m 2 / 2^n
    least_p = min(1.0, float(count * 2.0 ** (1 - blocks)))
    unclear = [row for row in others if _is_open(row)]
    worse, better = ([row for row in others if not _is_open(row) and sign * row["behind"] > 0] for sign in (1, -1))
    sentences = []
    if least_p >= LEVEL and len(unclear) == len(others):
        sentences.append(
            f"These are too few {paired} to show any difference: over {blocks} paired {paired} Wilcoxon's p cannot be "
            f"below {least_p:.2g} after Holm over {counted(count, 'pair')}. The next one is {effect(others[0])}."
        )
        unclear = []
    elif len(worse) == len(others):
        sentences.append(f"Every other method is worse, the next one is {effect(worse[0])}.")
    elif worse:
        sentences.append(f"It is better than {listed([row['name'] for row in worse])}.")
    if better:
        sentences.append(f"On most {paired} it is worse than {listed([*map(effect, better)])}.")
    if unclear:
        sentences.append(f"These {paired} are too few to tell it from {listed([*map(effect, unclear)])}.")
    return [
        *sentences,
        f"In brackets: median of {blocks} paired differences, its 95 % interval, and Wilcoxon's p after Holm, below "
        "0.05 where a difference is shown.",
    ]


def _lost_sentence(rows: Sequence[Row]) -> list[str]:
    """Return in how many of their tracks some methods lost frames; none if none did."""
    by = _series([f"{row['lost_tracks']} by {row['name']}" for row in rows])
    return (
        [f"Tracks with lost frames, of {rows[0]['runs']} each: {by}."]
        if any(row["lost_tracks"] for row in rows)
        else []
    )


def _baseline_sentence(first: Row, baselines: Sequence[Row]) -> list[str]:
    """Return the best baseline; none if there is none."""
    known = [row for row in baselines if row["error"] is not None]
    if not known:
        return []
    best = min(known, key=lambda row: float(row["error"]))
    text = f"best baseline, the {BASELINES[best['baseline']]}, has {best['error']:.2f}°."
    return [f"The {text}" if best["error"] > first["error"] else f"It does not beat the baselines: the {text}"]


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
        return _series([*names[: NAMED - 1], f"{len(names) - NAMED + 1} others"])
    return _series(names)


def _series(values: Sequence[Any]) -> str:
    """Return values as a list in a sentence; where they have commas themselves, semicolons separate them."""
    *texts, last = map(str, values)
    comma = "; " if any(", " in text for text in (*texts, last)) else ", "
    return f"{comma.join(texts)}{';' if texts and comma == '; ' else ''} and {last}" if texts else last
