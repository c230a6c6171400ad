"""The sentences of a report's first screen: which method leads, and how certainly."""

import math
from collections.abc import Sequence

from posefit.errors import printable
from posefit.reading import counted
from posefit.report.columns import listed, p_text
from posefit.report.contest import Contest
from posefit.report.leaderboard import Standing, Standings
from posefit.statistics.paired import (
    POWER,
    SIGNIFICANCE,
    PairedTest,
    fewest_blocks,
)

# If a difference would take more seeds or instances, the methods are practically equal.
MAX_NEEDED = 1000

Tested = tuple[Standing, PairedTest]  # a method that was tested against the first one


def leader_sentences(standings: Standings) -> list[str]:
    """Return the sentences about the leader.

    The first sentence names the first method with its losses and its error, and the
    methods that a test shows to be worse, with the difference, its interval and p. The
    next ones name the methods from which no difference is shown, and how many seeds
    would show one.
    """
    contest = standings.contest
    kind = contest.runs.kind
    first, *others = (row for row in standings.board if row.taking_part)
    tested = [(row, row.test) for row in others if row.test]
    shown = [pair for pair in tested if pair[1].adjusted < SIGNIFICANCE]
    unclear = [pair for pair in tested if pair[1].adjusted >= SIGNIFICANCE]
    worse = [pair for pair in shown if pair[1].difference > 0.0]
    better = [pair for pair in shown if pair[1].difference <= 0.0]
    where = f"{kind.instance_words(contest)} with {contest.seed_words}"
    facts = f"{_losses_and_score(contest, first)} on {where}"
    if worse:
        text = f"{first.name} {facts}; it leads {_worse_methods(contest, worse)}."
    elif tested:
        text = f"No method leads; {first.name}, which comes first, {facts}."
    else:
        text = f"{first.name} {facts}."
    sentences = [text]
    if better:
        effects = listed([_effect(contest, *pair) for pair in better])
        sentences.append(f"It is worse than {effects}.")
    if unclear:
        effects = listed([_effect(contest, *pair) for pair in unclear])
        sentences.append(f"It does not differ significantly from {effects}.")
        sentences += _needed_blocks(contest, unclear)
    if not others:
        sentences.append("No other method shares its runs.")
    elif not tested:
        noun = kind.score.paired[:-1]
        sentences.append(f"One shared {noun} shows no difference between methods.")
    sentences += kind.baseline_sentences(contest, first.method, standings.baselines)
    return [*map(printable, sentences)]


def _losses_and_score(contest: Contest, row: Standing) -> str:
    """Return the end of a sentence: a method's losses, and its score with interval."""
    score = contest.runs.kind.score
    mean = row.figures[score.name]
    assert mean is not None  # as it takes part
    value = score.sentence.format(score.text(mean))
    if row.interval:
        low, high = map(score.text, row.interval)
        value += f" (95 % interval {low} to {high})"
    if row.lost_tracks is None:
        return value
    lost = row.lost_tracks or "none"
    return f"lost frames in {lost} of {counted(row.runs, 'track')} and {value}"


def _worse_methods(contest: Contest, worse: Sequence[Tested]) -> str:
    """Return the methods that are shown to be worse; the nearest has its difference."""
    score = contest.runs.kind.score
    (nearest, test), *more = sorted(worse, key=lambda pair: pair[1].difference)
    low = score.amount(test.low)
    high = score.amount(test.high)
    text = (
        f"{nearest.name} by {score.amount(test.difference)} "
        f"({low} to {high}, {p_text(test.adjusted)})"
    )
    if not more:
        return text
    names = listed([row.name for row, _ in more])
    p = p_text(max(test.adjusted for _, test in more))
    if len(more) > 1:
        p = p.replace("=", "at most")
    return f"{text}, and {names} by more ({p})"


def _effect(contest: Contest, row: Standing, test: PairedTest) -> str:
    """Return a method's name, difference from the first, interval, p and losses."""
    score = contest.runs.kind.score
    if _is_zero(test):
        return f"{row.name} (equal in all {score.paired})"
    details = [score.difference(test.difference)]
    if math.isfinite(test.low):
        low = score.difference(test.low)
        details.append(f"{low} to {score.difference(test.high)}")
    details.append(p_text(test.adjusted))
    if row.lost_tracks:
        details.append(f"lost in {row.lost_tracks} of {row.runs}")
    return f"{row.name} ({', '.join(details)})"


def _is_zero(test: PairedTest) -> bool:
    """Return whether the methods are equal in all runs."""
    return test.low == test.high == 0.0


def _needed_blocks(contest: Contest, unclear: Sequence[Tested]) -> list[str]:
    """Return a sentence about how many runs would show the differences.

    There is none about methods that are equal in all runs.
    """
    score = contest.runs.kind.score
    nearest, test = min(unclear, key=lambda pair: pair[1].blocks_needed)
    needed = test.blocks_needed
    methods, blocks = contest.tested_errors.shape[:2]
    fewest = fewest_blocks(len(contest.comparisons))
    # the spread of so few runs says little, so nothing is computed from it
    if blocks < fewest:
        return [
            f"{blocks} paired {score.paired} cannot show a difference between "
            f"{methods} methods: that takes at least {fewest}."
        ]
    if all(_is_zero(each) for _, each in unclear):
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
        f"If the difference from {nearest.name} is real, about "
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
