"""The sentences of a report's first screen: what leads what, by how much, and how certain that is."""

import math
from collections.abc import Sequence

from posefit.errors import printable
from posefit.reading import counted
from posefit.report.columns import listed, p_text
from posefit.report.kind import Contest, Row
from posefit.statistics.paired import POWER, SIGNIFICANCE

MAX_NEEDED = 1000  # seeds or instances; of more the methods are as good as equal


def leader_sentences(
    contest: Contest, board: Sequence[Row], baselines: Sequence[Row]
) -> list[str]:
    """Return the sentences of a report, given the leaderboard and the baselines' rows.

    The first has the losses and the error of the first method, and which methods it leads: those that a test shows to
    be worse, by how much, with interval and p. The next ones have the methods from which no difference is shown, and
    how many seeds would show one.
    """
    first, *others = (row for row in board if row["taking_part"])
    kind = contest.runs.kind
    where = f"{kind.place_words(contest)} with {contest.seed_words}"
    tested = [row for row in others if row["p"] is not None]
    different = [row for row in tested if row["p"] < SIGNIFICANCE]
    worse = [row for row in different if row["behind"] > 0.0]
    better = [row for row in different if row not in worse]
    unclear = [row for row in tested if row not in different]
    facts = f"{_value(contest, first)} on {where}"
    if worse:
        text = f"{first['name']} {facts}; it leads {_led(contest, worse, others)}."
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
        sentences.append(_power(contest, unclear))
    if not others:
        sentences.append("No other method shares its runs.")
    elif not tested:
        noun = kind.score.paired[:-1]
        sentences.append(f"One shared {noun} shows no difference between methods.")
    sentences += kind.baseline_sentences(first, baselines)
    return [*map(printable, sentences)]


def _value(contest: Contest, row: Row) -> str:
    """Return the losses and the score of a method, with its interval, as the end of a sentence."""
    score = contest.runs.kind.score
    value = score.sentence.format(score.text(row[score.name]))
    if row["low"] is not None:
        low = score.text(row["low"])
        value += f" (95 % interval {low} to {score.text(row['high'])})"
    if "lost_tracks" not in row:
        return value
    lost = row["lost_tracks"] or "none"
    return f"lost frames in {lost} of {counted(row['runs'], 'track')} and {value}"


def _led(contest: Contest, worse: Sequence[Row], others: Sequence[Row]) -> str:
    """Return the methods that are shown to be worse, the nearest one with its effect."""
    score = contest.runs.kind.score
    rising = sorted(worse, key=lambda row: float(row["behind"]))
    nearest = rising[0]
    details = [p_text(nearest["p"])]
    if math.isfinite(nearest["behind_low"]):
        low = score.amount(nearest["behind_low"])
        details.insert(0, f"{low} to {score.amount(nearest['behind_high'])}")
    effect = f"by {score.amount(nearest['behind'])} ({', '.join(details)})"
    if len(worse) == 1:
        return f"{nearest['name']} {effect}"
    if len(worse) == len(others):
        count = "both" if len(others) == 2 else f"all {len(others)}"
        return f"{count} others, the nearest of them, {nearest['name']}, {effect}"
    names = listed([row["name"] for row in rising[1:]])
    return f"{nearest['name']} {effect}, and {names} by more"


def _effect(contest: Contest, row: Row) -> str:
    """Return a method with how far it is behind the first, the interval of that, p, and its losses."""
    score = contest.runs.kind.score
    details = [score.difference(row["behind"])]
    if math.isfinite(row["behind_low"]):
        low = score.difference(row["behind_low"])
        details.append(f"{low} to {score.difference(row['behind_high'])}")
    details.append(p_text(row["p"]))
    if row.get("lost_tracks"):
        details.append(f"lost in {row['lost_tracks']} of {row['runs']}")
    return f"{row['name']} ({', '.join(details)})"


def _power(contest: Contest, unclear: Sequence[Row]) -> str:
    """Return how many seeds would show the differences that are not shown."""
    score = contest.runs.kind.score
    nearest = min(unclear, key=lambda row: float(row["blocks_needed"]))
    needed = nearest["blocks_needed"]
    unit = "instances"
    if score.paired == "runs":
        needed = needed / len(contest.instances)
        unit = "seeds of each instance"
    if needed > MAX_NEEDED:
        return (
            f"Not even {MAX_NEEDED:,} {unit} would show differences as small as these."
        )
    return (
        f"If the difference from {nearest['name']} is real, about {math.ceil(needed):,} {unit} would show it, "
        f"with a probability of {100 * POWER:.0f} %."
    )


def unpaired_sentence(contest: Contest) -> str:
    """Return how many finished runs are compared with nothing; "" if all are compared."""
    if not contest.left_out:
        return ""
    has, them = ("run is", "it") if contest.left_out == 1 else ("runs are", "them")
    return (
        f"{contest.left_out} finished {has} left out of the comparison, "
        f"as some method has no run to pair {them} with"
    )
