"""The list of figures, with units.

It covers the keys of summary.json, and the columns of frames.csv and of a sweep's CSV.
"""

from collections.abc import Iterable, Mapping

from posefit.evaluation.errors import FRAME
from posefit.evaluation.measures import BASELINES, MEASURES, Measure
from posefit.measuring.centres import PLACES
from posefit.report.charts import LEVEL_NAMES
from posefit.report.tracks import LOSS

# Units of values in files; the tables show them times a factor.
RAW = {"%": "share, 0 to 1", "ms": "s", "ms a frame": "s"}

# Keys of summary.json about the request, not the result.
REQUEST = {
    "motion": ("", "name of the motion, the video or the masks"),
    "source": ("", "one entry per camera"),
    "frames_chosen": ("frames", "start and stop of `--frames`, or null"),
    "method": ("", "the optimiser and the prior, or the tracker"),
    "seed": ("", "seed of all random numbers"),
    "frames": ("frames", "number of tracked frames"),
    "evaluations_per_frame": ("", "budget of a frame, in each track"),
    "version": ("", "of posefit"),
    "train": ("", "training motions"),
    "view_degrees": ("degrees", "directions of the cameras, or null"),
    "translation": ("", "the root's position: known, searched or aligned"),
    "first_pose": ("", "searched, or given"),
    "smooth": ("", "whether the track was [smoothed](../howto/smoothing.md)"),
    "views": ("", "number of cameras"),
    "camera": ("", "calibrated, guessed, or placed around a known motion"),
    "size_pixels": ("pixels", "size of the first camera's masks"),
    "fps": ("1/s", "frames per second"),
    "dimensions": (
        "",
        "coordinates of a proposal; null for a tracker that searches no box",
    ),
    "settings": ("", "settings that were chosen or follow from the budget"),
}

# Columns of a sweep's row besides the figures, in the CSV's order: first the request.
CELL = {
    "key": ("", "the row's name: the SHA-256 of everything on which it depends"),
    "version": ("", "versions of posefit and of the plugins that are not its own"),
    "status": ("", "`done`, or `quarantined` after three failed attempts"),
    "reason": ("", "why a quarantined cell failed"),
    "kind": ("", "`track` or `search`"),
    "method": ("", "the optimiser and the prior, or the tracker"),
    "motion": ("", "the motion that was tracked"),
    "train": ("", "training motions"),
    "settings": ("", "the chosen settings, as `NAME.SETTING=VALUE`"),
    "view_degrees": ("degrees", "directions of the cameras"),
    "corruption": ("", "kinds of damage to the masks, with their strengths"),
    "instance": ("", "number of the variation of the motion or the function"),
    "frames": ("frames", "number of tracked frames"),
    "fps": ("1/s", "frames per second"),
    "size": ("pixels", "width x height of the masks"),
    "evaluations": ("", "budget: of a frame, or of a search"),
    "translation": ("", "the root's position: known, searched or aligned"),
    "first_pose": ("", "searched, or given"),
    "hypotheses": ("", "number of tracks from which one was chosen"),
    "yaw_off_degrees": ("degrees", "largest error of the yaw given to the method"),
    "body_off_percent": ("%", "largest error of the body given to the method"),
    "seed": ("", "seed of all random numbers"),
    "name": ("", "the method's name in reports, if the plan gives one"),
}
SEARCH_CELL = {
    "suite": ("", "the numbered benchmark"),
    "function": ("", "the function's number"),
    "dimension": ("", "coordinates of the function"),
    "infeasible": ("", "how infeasible proposals are treated"),
}
SPENT = {
    "warnings": ("", "what to check before you trust the result"),
    "evaluations_used": ("", MEASURES["evaluations"].meaning),
    "dimensions": ("", "coordinates of a proposal"),
    "joint_errors_mm.JOINT": (
        "mm",
        "mean distance of one joint from the true one, both roots at one point",
    ),
    "seconds": ("s", "wall time of the whole cell"),
    LOSS: (
        "degrees",
        "`error_degrees.mean`, but a lost frame counts at least as much as the mean "
        "training pose: e + s max(0, b - e) with the error e, `lost_rate` s and "
        "`baselines_degrees.mean_pose` b",
    ),
    "command": ("", "repeats the cell, without the ledger"),
}
SEARCHED = {
    "cost": ("", "the lowest cost"),
    "truth_cost": ("", "the cost of the true pose"),
    "reached": ("%", "share of the targets that were reached"),
    "above": ("", "`cost` less `truth_cost`"),
}
LEADERBOARD = {
    "low": ("", "lower end of the 95 % interval of the first figure"),
    "high": ("", "upper end"),
    "behind": ("", "mean difference of paired runs from the method of the first row"),
    "behind_low": ("", "lower end of its 95 % interval, adjusted in the same way as p"),
    "behind_high": ("", "upper end"),
    "p": (
        "",
        "of that difference: a paired t test with Holm's correction over all pairs",
    ),
    "blocks_needed": (
        "",
        "paired runs that would show that difference with a probability of 80 %",
    ),
    "lost_tracks": ("", "tracks with lost frames"),
    "runs": ("", "runs that are compared"),
    "failed": ("", "cells in quarantine"),
    "warned": ("", "runs with a warning"),
}
# figures with a value for each of some names
PARTS = {
    "error_degrees": ("mean", "std", "max"),
    "effort": ("STAGE",),
    "skill": tuple(BASELINES),
    "baselines_degrees": tuple(BASELINES),
    "baselines_mm": tuple(BASELINES),
    "coverage": LEVEL_NAMES,
    "interval_mm": LEVEL_NAMES,
}
NOT_IN_ROWS = ("evaluations", "evaluations_per_second")
RESULT = {
    "hypotheses": (
        "",
        "for each [hypothesis](../howto/hypotheses.md): `beginning`, `cost`, "
        "`motion` term, and `kept`",
    ),
    "build": (
        "m",
        "the fitted body: `stature_m`, `factors` on the average and their `spread`; "
        "or null",
    ),
    "trace": (
        "",
        "of a single frame: evaluations so far and best cost after each population",
    ),
    "warnings": ("", "what to check before you trust the result"),
    "guesses": ("", "what posefit assumed, such as the camera, the rate or a height"),
    "modes": (
        "",
        "weights of the possible tracks of the whole motion, the likeliest first",
    ),
    "none_of_modes": ("", "mean probability that no mode of a frame is right"),
    "unknown_sides": ("", "frames in which left and right are called unknown"),
    "lost_frames": ("", "frames that are called lost"),
    "relocalised": (
        "",
        "frames after which the person was searched for again in all directions",
    ),
    "retracked_outside": (
        "",
        "first and last frame of what "
        "[was not tracked again](../howto/smoothing.md#a-body-that-spins)",
    ),
    "backwards_share": (
        "",
        "share of frames in which the root faces away from its path, "
        "at more than 0.3 m/s",
    ),
    "trust": (
        "",
        "of footage, whether the track [can be trusted](../howto/trust.md), and why",
    ),
    "gait": (
        "",
        "[figures of the walk](../howto/measuring.md), or `why` there are none",
    ),
}
HEAD = "| {0} | meaning |\n|---|---|"

Descriptions = Mapping[str, tuple[str, str]]


def page() -> str:
    """Return the three tables, as Markdown."""
    parts = [
        "## Keys of `summary.json`",
        "`posefit track --json` prints the same object. "
        "The request comes first, then the results.",
        _table("key", _described(REQUEST)),
        _table("key", [*_measured(MEASURES.values()), *_described(RESULT)]),
        "`error_degrees` contains `mean`, `std` and `max` over the frames. `skill`, "
        "`baselines_degrees` and "
        f"`baselines_mm` contain one number for each baseline: {_baselines()}. "
        "`coverage` and `interval_mm` contain one for each of `50`, `80` and `95`. A "
        "figure is `null` if it needs an unknown truth, or if the method does not "
        "report it.",
        "## Columns of `frames.csv`",
        "One row per frame. Columns that need the truth exist only if it is known. "
        f"{_shared()} are as above, for one frame. The others are",
        _table(
            "column",
            [*_measured(_frame_only()), ("PLACE_x, PLACE_y, PLACE_z", "m", _joints())],
        ),
        "## Columns of a sweep's CSV",
        "`posefit report DIR --csv FILE.csv` writes one row per cell. "
        "`Ledger.frame()` gives the same as a table of pandas, except the last two "
        "columns. "
        "The report's page and its data have every figure under the same name.",
        _table("column", [*_described(CELL), *_row_measures(), *_described(SPENT)]),
        "A row of a single search has the columns from `key` to `settings`, then "
        "`instance`, `evaluations`, `seed`, `name`, the last columns of the table "
        "above, and",
        _table("column", _described({**SEARCH_CELL, **SEARCHED})),
        "## Columns of `leaderboard.csv`",
        "`posefit report DIR --figures FOLDER` writes one row per method in the order "
        "of the leaderboard: `method`, `settings`, the mean of each figure above that "
        "the page has, `error_with_losses_degrees` first, and",
        _table("column", _described(LEADERBOARD)),
    ]
    return "\n\n".join(parts) + "\n"


def _measured(measures: Iterable[Measure]) -> list[tuple[str, str, str]]:
    return [
        (one.name, one.unit if one.factor == 1.0 else RAW[one.unit], one.meaning)
        for one in measures
    ]


def _row_measures() -> list[tuple[str, str, str]]:
    """Return the figures of a track as columns, one for each part."""
    columns = []
    for name, unit, meaning in _measured(MEASURES.values()):
        if name in NOT_IN_ROWS:
            continue
        parts = PARTS.get(name)
        names = [f"{name}.{part}" for part in parts] if parts else [name]
        columns += [("`, `".join(names), unit, meaning)]
    return columns


def _described(values: Descriptions) -> list[tuple[str, str, str]]:
    return [(name, unit, meaning) for name, (unit, meaning) in values.items()]


def _frame_only() -> list[Measure]:
    return [measure for name, measure in FRAME.items() if name not in MEASURES]


def _shared() -> str:
    return ", ".join(f"`{name}`" for name in FRAME if name in MEASURES)


def _joints() -> str:
    return (
        f"place in the world of each of the {len(PLACES)} [joints](joints.md), "
        "blank if held or called lost"
    )


def _baselines() -> str:
    return ", ".join(f"`{name}` (the {label})" for name, label in BASELINES.items())


def _table(head: str, rows: Iterable[tuple[str, str, str]]) -> str:
    lines = (
        f"| `{name}` | {f'{unit}: ' if unit else ''}{meaning} |"
        for name, unit, meaning in rows
    )
    return "\n".join([HEAD.format(head), *lines])
