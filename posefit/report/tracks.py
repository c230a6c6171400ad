"""Tracks in a report: their figures, names, intervals and baselines, and what the page has of them alone.

Label, unit, digits and meaning of figures come from `posefit.evaluation.measures`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.evaluation.measures import BASELINES, MEASURES, Measure
from posefit.fitting.metrics import skill
from posefit.reading import counted
from posefit.report.columns import (
    NAMED,
    Column,
    Score,
    interquartile_mean,
    listed,
    mean,
)
from posefit.report.kind import Contest, Kind, Place, Runs
from posefit.statistics.intervals import iqm_intervals
from posefit.uncertainty.calibration import BINS, LEVELS

# of intervals, as rows have them
LEVEL_NAMES = tuple(f"{100 * level:.0f}" for level in LEVELS)
TABLE_LEVEL = "80"  # the interval that tables show
MAX_SEEDS = 50  # that the facts list
NO_MODES: Array = np.zeros((BINS, 3), dtype=np.float32)


def _share(name: str) -> Measure:
    """Return a share with a digit more than for one track: a mean over runs may lie between whole percents."""
    return replace(MEASURES[name], digits=MEASURES[name].digits + 1)


def _skill_measure(baseline: str) -> Measure:
    measure = MEASURES["skill"]
    label = BASELINES[baseline]
    return replace(
        measure,
        label=f"{measure.label}: {label}",
        meaning=f"{measure.meaning}; compared with the {label}",
    )


def _interval_columns() -> list[Column]:
    """Return coverage and width of the intervals of each level."""
    columns = []
    for level in LEVEL_NAMES:
        coverage = replace(_share("coverage"), label=f"{level} % interval holds")
        width = replace(MEASURES["interval_mm"], label=f"{level} % interval")
        more: dict[str, Any] = {"optional": True, "in_tables": level == TABLE_LEVEL}
        columns += [
            Column(
                f"coverage_{level}",
                coverage,
                ("coverage", level),
                higher_is_better=True,
                average=mean,
                **more,
            ),
            Column(f"interval_{level}", width, ("interval_mm", level), **more),
        ]
    return columns


_TIME = MEASURES["seconds_per_frame"]
_CPU = MEASURES["cpu_seconds_per_frame"]
_EVALUATIONS = replace(
    MEASURES["evaluations"],
    unit="a frame",
    meaning="poses whose cost was computed, the mean over frames",
)
_BASELINE = MEASURES["baselines_degrees"]
COLUMNS = (
    Column("error", MEASURES["error_degrees"], ("error_degrees", "mean")),
    *(
        Column(
            f"skill_{name}",
            _skill_measure(name),
            ("skill", name),
            higher_is_better=True,
        )
        for name in BASELINES
    ),
    Column("lost", _share("lost_rate"), ("lost_rate",), average=mean),
    Column("swapped", _share("swap_rate"), ("swap_rate",), average=mean),
    Column(
        "unknown",
        _share("unknown_rate"),
        ("unknown_rate",),
        optional=True,
        average=mean,
    ),
    *_interval_columns(),
    Column("mpjpe", MEASURES["mpjpe_mm"], ("mpjpe_mm",)),
    Column("iou", MEASURES["iou"], ("iou",), higher_is_better=True),
    Column(
        "ms", replace(_TIME, factor=1.0), ("seconds_per_frame",), scale=_TIME.factor
    ),
    Column(
        "cpu_ms",
        replace(_CPU, factor=1.0),
        ("cpu_seconds_per_frame",),
        scale=_CPU.factor,
    ),
    Column("evaluations", _EVALUATIONS, ("evaluations_used",), per_frame=True),
    *(
        Column(
            f"baseline_{name}",
            replace(_BASELINE, label=label),
            ("baselines_degrees", name),
            in_tables=False,
        )
        for name, label in BASELINES.items()
    ),
)


SCORE = Score(
    name="error",
    axis="error in degrees",
    sentence="an error of {}",
    unit="°",
    points="°",
    digits=2,
    down=False,
    paired="runs",
    caption="Interquartile mean of a method's errors, with its 95 % interval from several seeds and eight runs on; "
    "dashed lines are baselines.",
    leaderboard="Each figure is the interquartile mean of a method's runs; shares of frames and joints are means. "
    "Skill is 1 − error / baseline, of the errors in this table: 0 is no better than the baseline, which uses the "
    "true root and translation. ",
)


def _read(
    row: Mapping[str, Any], shared: dict[bytes, Any]
) -> tuple[Array, tuple[Any, ...]]:
    """Return the figures of a row and its other data; many rows share the evaluations of their traces."""
    used = np.array(row["trace"]["evaluations"], np.float32)
    trace = (
        shared.setdefault(used.tobytes(), used),
        np.array(row["trace"]["cost"], np.float32),
    )
    joints = np.array(row["joint_errors_mm"], dtype=np.float32)
    figures = np.array([column.value(row) for column in COLUMNS])
    return figures, (joints, _binned(row["mode_reliability"]), trace)


def _rank(place: Place) -> tuple[Any, ...]:
    corruption = sorted(place["corruption"].items())  # undamaged instances come first
    return (
        place["motion"],
        place["view_degrees"],
        len(corruption),
        corruption,
        place["instance"],
    )


def _place_name(place: Place) -> str:
    directions = ", ".join(f"{view}°" for view in views(place))
    return ", ".join(
        [
            f"{place['motion']}, view {directions}",
            *damage(place),
            f"instance {place['instance']}",
        ]
    )


def _tested_errors(contest: Contest) -> Array:
    """Return the errors (methods, blocks, 1) that tests compare: a block is an instance with a seed."""
    return np.asarray(contest.runs.figures["error"][contest.blocks][:, :, None])


def _board(contest: Contest) -> dict[int, dict[str, Any]]:
    """Return what each method's row has besides averages: an interval, skills, and how many tracks lost frames.

    A skill is 1 - the row's error / the baseline's on the same runs.
    """
    errors = contest.of("error")
    figures = contest.runs.figures
    intervals = iqm_intervals(
        errors, contest.rng(), resamples=contest.resamples(errors.size)
    )
    ends: dict[int, dict[str, Any]] = {
        m: {"low": low, "high": high}
        for m, low, high in zip(
            contest.methods,
            intervals.low.tolist(),
            intervals.high.tolist(),
            strict=True,
        )
    }
    shared = {row["baseline"]: row["error"] for row in _baseline_rows(contest)}
    board = {}
    for m in range(len(contest.runs.methods)):
        rows = contest.rows_of(m)
        error = interquartile_mean(figures["error"][rows])
        unshared = {
            name: interquartile_mean(figures[f"baseline_{name}"][rows])
            for name in BASELINES
        }
        board[m] = ends.get(m, {"low": None, "high": None}) | _skills(
            error, shared if m in ends else unshared
        )
        board[m]["lost_tracks"] = int((figures["lost"][rows] > 0.0).sum())
    return board


def _baseline_rows(contest: Contest) -> list[dict[str, Any]]:
    """Return a row for each baseline, on the same runs as the methods: means over the methods that have a value."""
    values = {
        name: np.ma.masked_invalid(contest.of(f"baseline_{name}")) for name in BASELINES
    }
    errors = {
        name: interquartile_mean(errors.mean(axis=0).filled(np.nan))
        for name, errors in values.items()
    }
    return [
        {"baseline": name, "error": error, **_skills(error, errors)}
        for name, error in errors.items()
    ]


def _place_words(contest: Contest) -> str:
    motions = sorted({str(place["motion"]) for place in contest.places()})
    names = listed(motions) if len(motions) <= NAMED else f"{len(motions)} motions"
    return f"{counted(len(contest.instances), 'instance')} of {names}"


def _baseline_sentences(first: Mapping[str, Any], rows: Sequence[Any]) -> list[str]:
    known = [row for row in rows if row["error"] is not None]
    if not known:
        return []
    best = min(known, key=lambda row: float(row["error"]))
    text = (
        f"best baseline, the {BASELINES[best['baseline']]}, has {best['error']:.2f}°."
    )
    return [
        f"The {text}"
        if best["error"] > first["error"]
        else f"It does not beat the baselines: the {text}"
    ]


def _facts(runs: Runs) -> dict[str, Any]:
    frames = np.array([place["frames"] for place in runs.places], dtype=int)[
        runs.instance
    ]
    hours = float(np.nansum(runs.figures["ms"] * frames) / 3.6e6)
    seeds = [*map(str, runs.seeds[:MAX_SEEDS])]
    return {
        "instances": f"{len(runs.instances):,}",
        "motions": runs.values("motion"),
        "views, degrees": sorted({", ".join(views(place)) for place in runs.places}),
        "corruptions": sorted(
            {", ".join(damage(place)) or "none" for place in runs.places}
        ),
        "frames": runs.values("frames"),
        "translation": runs.values("translation"),
        "seeds": [*seeds, f"… ({len(runs.seeds):,})"]
        if len(runs.seeds) > MAX_SEEDS
        else seeds,
        "evaluations a frame": [f"{budget:,}" for budget in runs.values("evaluations")],
        "time of the searches": f"{60 * hours:.1f} minutes"
        if hours < 0.1
        else f"{hours:.1f} hours",
    }


def _binned(modes: Sequence[Sequence[float]]) -> Array:
    """Return a row's likeliest modes by bins (bins, 3) of probability: frames, sum of probabilities, frames right."""
    if not modes:
        return NO_MODES
    bins = np.zeros((BINS, 3), dtype=np.float32)
    for count, probability, right in modes:
        bins[min(int(probability * BINS), BINS - 1)] += count * np.array(
            [1.0, probability, right]
        )
    return np.asarray(bins)


def _skills(
    error: float | None, baselines: Mapping[str, float | None]
) -> dict[str, float | None]:
    return {
        f"skill_{name}": None
        if error is None or baseline is None
        else skill(error, baseline)
        for name, baseline in baselines.items()
    }


def views(place: Place) -> list[str]:
    """Return the directions of an instance's cameras in degrees."""
    return [f"{view:g}" for view in place["view_degrees"]]


def damage(place: Place) -> list[str]:
    """Return the kinds of damage of an instance with their strengths."""
    return [
        f"{kind} {strength:g}" for kind, strength in sorted(place["corruption"].items())
    ]


TRACKS = Kind(
    name="track",
    noun="tracks",
    title="Report of a sweep",
    columns={column.name: column for column in COLUMNS},
    named=("motion", "view_degrees", "corruption", "instance"),
    # (27,) mm; (bins, 3), see `_binned`; evaluations and best costs
    data=("joint_errors", "modes", "traces"),
    baselines=BASELINES,
    score=SCORE,
    read=_read,
    rank=_rank,
    place_name=_place_name,
    tested_errors=_tested_errors,
    board=_board,
    baseline_rows=_baseline_rows,
    place_words=_place_words,
    baseline_sentences=_baseline_sentences,
    facts=_facts,
)
