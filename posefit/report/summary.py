"""The sentences of a report's first screen: which method leads, and how certainly."""

import math
from collections.abc import Sequence

from posefit.errors import printable
from posefit.reading import counted
from posefit.report.columns import listed, p_text
from posefit.report.contest import Contest, Row
from posefit.statistics.paired import POWER, SIGNIFICANCE, fewest_blocks

# If a difference would take more seeds or instances, the methods are practically equal.
MAX_NEEDED = 1000


def leader_sentences(
    contest: Contest, board: Sequence[Row], baselines: Sequence[Row]
) -> list[str]:
    """Return the sentences about the leader.

    The first sentence names the first method with its losses and its error, and the
    methods that a test shows to be worse, with the difference, its interval and p. The
    next ones name the methods from which no difference is shown, and how many seeds
    would show one.

    Args:
        contest: The methods and the runs that they share.
        board: The rows of the leaderboard.
        baselines: The rows of the baselines.

    Returns:
        The sentences.
    """
    first, *others = (row for row in board if row["taking_part"])
    kind = contest.runs.kind
    where = f"{kind.place_words(contest)} with {contest.seed_words}"
    tested = []
    worse = []
    better = []
    unclear = []
    for row in others:
        if row["p"] is None:
            continue
        tested.append(row)
        if row["p"] >= SIGNIFICANCE:
            unclear.append(row)
        elif row["behind"] > 0.0:
            worse.append(row)
        else:
            better.append(row)
    facts = f"{_value(contest, first)} on {where}"
    if worse:
        text = f"{first['name']} {facts}; it leads {_led(contest, worse)}."
    elif tested:
        text = f"No method leads; {first['name']}, which comes first, {facts}."
    else:
        text = f"{first['name']} {facts}."
    sentences = [text]
    if better:
        effects = listed([_effect(contest, row) for row in better])
        sentences.append(f"It is worse than {effects}.")
    if unclear:
        effects = listed([_effect(contest, row) for row in unclear])
        sentences.append(f"No difference is shown from {effects}.")
        sentences += _power(contest, unclear)
    if not others:
        sentences.append("No other method shares its runs.")
    elif not tested:
        noun = kind.score.paired[:-1]
        sentences.append(f"One shared {noun} shows no difference between methods.")
    sentences += kind.baseline_sentences(first, baselines)
    return [*map(printable, sentences)]


def _value(contest: Contest, row: Row) -> str:
    """Return the end of a sentence: a method's losses, and its score with interval."""
    score = contest.runs.kind.score
    value = score.sentence.format(score.text(row[score.name]))
    if row["low"] is not None:
        low = score.text(row["low"])
        value += f" (95 % interval {low} to {score.text(row['high'])})"
    if "lost_tracks" not in row:
        return value
    lost = row["lost_tracks"] or "none"
    return f"lost frames in {lost} of {counted(row['runs'], 'track')} and {value}"


def _led(contest: Contest, worse: Sequence[Row]) -> str:
    """Return the methods that are shown to be worse; the nearest has its difference."""
    score = contest.runs.kind.score
    nearest, *more = sorted(worse, key=lambda row: float(row["behind"]))
    low = score.amount(nearest["behind_low"])
    high = score.amount(nearest["behind_high"])
    text = (
        f"{nearest['name']} by {score.amount(nearest['behind'])} "
        f"({low} to {high}, {p_text(nearest['p'])})"
    )
    if not more:
        return text
    names = listed([row["name"] for row in more])
    p = p_text(max(row["p"] for row in more))
    if len(more) > 1:
        p = p.replace("=", "at most")
    return f"{text}, and {names} by more ({p})"


def _effect(contest: Contest, row: Row) -> str:
    """Return a method's name, difference from the first, interval, p and losses."""
    score = contest.runs.kind.score
    if row["behind_low"] == row["behind_high"] == 0.0:
        return f"{row['name']} (equal in all {score.paired})"
    details = [score.difference(row["behind"])]
    if math.isfinite(row["behind_low"]):
        low = score.difference(row["behind_low"])
        details.append(f"{low} to {score.difference(row['behind_high'])}")
    details.append(p_text(row["p"]))
    if row.get("lost_tracks"):
        details.append(f"lost in {row['lost_tracks']} of {row['runs']}")
    return f"{row['name']} ({', '.join(details)})"


def _power(contest: Contest, unclear: Sequence[Row]) -> list[str]:
    """Return a sentence about how many runs would show the differences.

    There is none about methods that are equal in all runs.
    """
    score = contest.runs.kind.score
    nearest = min(unclear, key=lambda row: float(row["blocks_needed"]))
    needed = nearest["blocks_needed"]
    methods, blocks = contest.tested_errors.shape[:2]
    fewest = fewest_blocks(len(contest.comparisons))
    # the spread of so few runs says little, so nothing is computed from it
    if blocks < fewest:
        return [
            f"{blocks} paired {score.paired} cannot show a difference between "
            f"{methods} methods: that takes at least {fewest}."
        ]
    if all(row["behind_low"] == row["behind_high"] for row in unclear):
        return []
    unit = "instances"
    if score.paired == "runs":
        needed = needed / len(contest.instances)
        unit = "seeds of each instance"
    # a difference of nearly 0 would need millions of runs, a number that misleads
    if needed > MAX_NEEDED:
        return [
            f"Not even {MAX_NEEDED:,} {unit} would show differences as small as these."
        ]
    return [
        f"If the difference from {nearest['name']} is real, about "
        f"{math.ceil(needed):,} {unit} would show it, "
        f"with a probability of {100 * POWER:.0f} %."
    ]


def unpaired_sentence(contest: Contest) -> str:
    """Return a sentence about finished runs that are not compared, "" if all are."""
    if not contest.left_out:
        return ""
    has, them = ("run is", "it") if contest.left_out == 1 else ("runs are", "them")
    return (
        f"{contest.left_out} finished {has} left out of the comparison, "
        f"as some method has no run to pair {them} with"
    )
