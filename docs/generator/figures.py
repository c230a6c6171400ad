"""The list of the figures: the keys of summary.json, the columns of frames.csv and of a sweep's CSV, with units."""

from collections.abc import Iterable, Mapping

from posefit.evaluation.errors import FRAME
from posefit.evaluation.measures import BASELINES, MEASURES, Measure
from posefit.measuring.centres import PLACES

# How a value stands in a file whose table shows it times a factor.
RAW = {"%": "share, 0 to 1", "ms": "s", "ms a frame": "s"}

# What summary.json says beside the figures: the question, not the answer.
REQUEST = {
    "motion": ("", "name of the motion, the video or the masks"),
    "source": ("", "one entry a camera"),
    "frames_chosen": ("frames", "start and stop of `--frames`, or null"),
    "method": ("", "the optimiser and the prior, or the tracker"),
    "seed": ("", "of everything random"),
    "frames": ("frames", "how many were followed"),
    "evaluations_per_frame": ("", "budget of a frame, in each track"),
    "version": ("", "of posefit"),
    "train": ("", "motions learned from"),
    "view_degrees": ("degrees", "directions of the cameras, or null"),
    "translation": ("", "the root's position: known, searched or aligned"),
    "first_pose": ("", "searched, or given"),
    "smooth": ("", "whether the track was [smoothed](../howto/smoothing.md)"),
    "views": ("", "number of cameras"),
    "camera": ("", "calibrated, guessed, or placed around a known motion"),
    "size_pixels": ("pixels", "of the first camera's masks"),
    "fps": ("1/s", "frames a second"),
    "dimensions": (
        "",
        "coordinates of a proposal; null of a tracker that searches no box",
    ),
    "settings": ("", "what was set, or follows from the budget"),
}

# What a sweep's row says beside the figures.
ROW = {
    "key": ("", "the cell's name: the SHA-256 of everything it depends on"),
    "version": ("", "versions of posefit and of the plugins that are not its own"),
    "status": ("", "`done` or `quarantined`, after three failed attempts"),
    "reason": ("", "why a quarantined cell failed"),
    "kind": ("", "`track` or `search`"),
    "evaluations_used": (
        "",
        "`evaluations` of summary.json; here `evaluations` is the budget of a frame",
    ),
    "seconds": ("s", "wall time of the whole cell"),
    "joint_errors_mm.JOINT": (
        "mm",
        "mean distance of one joint from the true one, both roots at one point",
    ),
}
SPENT = ("evaluations_used", "seconds", "joint_errors_mm.JOINT")
RESULT = {
    "hypotheses": (
        "",
        "of each [hypothesis](../howto/hypotheses.md): `beginning`, `cost`, `motion` term, and `kept`",
    ),
    "build": (
        "m",
        "what was fitted: `stature_m`, `factors` on the average and their `spread`; or null",
    ),
    "trace": (
        "",
        "of a single frame: evaluations so far and best cost, after each population",
    ),
    "warnings": ("", "what to look at before the result is trusted"),
    "guesses": ("", "what posefit assumed, such as the camera, the rate or a height"),
    "modes": (
        "",
        "weights of the tracks that the whole motion may be, the likeliest first",
    ),
    "none_of_modes": ("", "mean probability that no mode of a frame is right"),
    "unknown_sides": ("", "frames whose left and right are called unknown"),
    "lost_frames": ("", "frames that are called lost"),
    "relocalised": (
        "",
        "frames from which the person was searched for all around again",
    ),
    "retracked_outside": (
        "",
        "first and last frame of what [was not tracked again](../howto/smoothing.md#a-body-that-spins)",
    ),
    "backwards_share": (
        "",
        "share of frames in which the root faces away from its path, faster than 0.3 m/s",
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
        "`posefit track --json` prints the same object. First the request, then the results.",
        _table("key", _described(REQUEST)),
        _table("key", [*_measured(MEASURES.values()), *_described(RESULT)]),
        "`error_degrees` holds `mean`, `std` and `max` over the frames. `skill`, `baselines_degrees` and "
        f"`baselines_mm` hold one number for each baseline: {_baselines()}. "
        "`coverage` and `interval_mm` hold one for each of `50`, `80` and `95`. What needs a truth that is unknown, or "
        "what the method does not report, is `null`.",
        "## Columns of `frames.csv`",
        "One row a frame; those that need the truth are there only where it is known. "
        f"{_shared()} are as above, of one frame. Then there are",
        _table(
            "column",
            [*_measured(_frame_only()), ("PLACE_x, PLACE_y, PLACE_z", "m", _joints())],
        ),
        "## Columns of a sweep's CSV",
        "`posefit report DIR --out FILE.html --csv FILE.csv` writes one row a cell; `Ledger.frame()` gives the same as "
        "a table of pandas. Columns of several values are `NAME.PART`, as in `error_degrees.mean` and "
        "`baselines_degrees.mean_pose`.",
        "What the cell is: the fields [of a plan](../howto/plan.md#the-fields-of-a-cell), and",
        _table(
            "column",
            _described(
                {
                    name: ROW[name]
                    for name in ("key", "version", "status", "reason", "kind")
                }
            ),
        ),
        "What it measured: the results of [`summary.json`](#keys-of-summary-json) but `evaluations_per_second`, and",
        _table("column", _described({name: ROW[name] for name in SPENT})),
    ]
    return "\n\n".join(parts) + "\n"


def _measured(measures: Iterable[Measure]) -> list[tuple[str, str, str]]:
    return [
        (one.name, one.unit if one.factor == 1.0 else RAW[one.unit], one.meaning)
        for one in measures
    ]


def _described(values: Descriptions) -> list[tuple[str, str, str]]:
    return [(name, unit, meaning) for name, (unit, meaning) in values.items()]


def _frame_only() -> list[Measure]:
    return [measure for name, measure in FRAME.items() if name not in MEASURES]


def _shared() -> str:
    return ", ".join(f"`{name}`" for name in FRAME if name in MEASURES)


def _joints() -> str:
    return f"place in the world of each of the {len(PLACES)} [joints](joints.md), blank where held or called lost"


def _baselines() -> str:
    return ", ".join(f"`{name}` (the {label})" for name, label in BASELINES.items())


def _table(head: str, rows: Iterable[tuple[str, str, str]]) -> str:
    lines = (
        f"| `{name}` | {f'{unit}: ' if unit else ''}{meaning} |"
        for name, unit, meaning in rows
    )
    return "\n".join([HEAD.format(head), *lines])
