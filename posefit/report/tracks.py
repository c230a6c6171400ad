"""Tracks in a report: their figures, names, intervals, baselines and page.

`posefit.evaluation.measures` has the label, unit, digits and meaning of each figure.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, replace
from operator import itemgetter
from types import MappingProxyType
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.evaluation.measures import BASELINES, MEASURES, Measure
from posefit.fitting.metrics import skill
from posefit.measuring.centres import PLACES
from posefit.reading import counted
from posefit.report import charts
from posefit.report.columns import MAX_NAMES, Column, Score, listed
from posefit.report.contest import Baseline, Contest, Indices, InstanceFields, Row, Runs
from posefit.report.stored import Packed, Store, Traces
from posefit.sweep.repeat import END, TRACK_BEGIN, plan_lines, track_fields
from posefit.sweep.table import damage, views
from posefit.uncertainty.calibration import BINS

LOSS = "error_with_losses_degrees"
LOSS_BASELINE = "mean_pose"  # a lost frame has at least the error of this baseline
TABLE_LEVEL = "80"  # the level, in percent, of intervals in tables
MAX_SEEDS = 50  # the most seeds that the facts list
NO_MODES: Array = np.zeros((BINS, 3), dtype=np.float32)


def error_with_losses(row: Row) -> float:
    """Return a track's error with losses, in degrees.

    In it a lost frame counts at least as much as the mean training pose, because its
    estimate is of no more use than that pose, which needs no masks. With the track's
    error e, its share of lost frames s and the error b of the mean training pose, the
    result is e + s max(0, b - e).

    Args:
        row: A row of a ledger.

    Returns:
        The error, nan if the row has no error.
    """
    if row["error_degrees"] is None:
        return math.nan
    error = float(row["error_degrees"]["mean"])
    lost = float(row["lost_rate"] or 0.0)
    baseline = (row["baselines_degrees"] or {}).get(LOSS_BASELINE)
    if baseline is None:
        return error
    return error + lost * max(0.0, float(baseline) - error)


def _share(name: str) -> Measure:
    """Return a share with one digit more than for a single track.

    A mean over runs may lie between the values that a single track can have.
    """
    return replace(MEASURES[name], digits=MEASURES[name].digits + 1)


def _skill_columns() -> list[Column]:
    """Return the skills over each baseline."""
    measure = MEASURES["skill"]
    columns = []
    for name, label in BASELINES.items():
        skill_measure = replace(
            measure,
            name=f"skill.{name}",
            label=f"{measure.label}: {label}",
            meaning=f"{measure.meaning}; compared with the {label}",
        )
        columns.append(Column(skill_measure, higher_is_better=True))
    return columns


def _baseline_columns() -> list[Column]:
    """Return the errors of the baselines."""
    columns = []
    for name, label in BASELINES.items():
        measure = replace(
            MEASURES["baselines_degrees"], name=f"baselines_degrees.{name}", label=label
        )
        columns.append(Column(measure, in_tables=False))
    return columns


def _interval_columns() -> list[Column]:
    """Return how often intervals of each level contain the truth, and their widths."""
    columns = []
    for level in charts.LEVEL_NAMES:
        shown = level == TABLE_LEVEL
        coverage = replace(
            _share("coverage"),
            name=f"coverage.{level}",
            label=f"within {level} % intervals",
        )
        width = replace(
            MEASURES["interval_mm"],
            name=f"interval_mm.{level}",
            label=f"{level} % interval",
        )
        columns += [
            Column(coverage, higher_is_better=True, in_tables=shown, optional=True),
            Column(width, in_tables=shown, optional=True),
        ]
    return columns


def _columns() -> list[Column]:
    """Return the figures of a track."""
    loss = Measure(
        LOSS,
        "error with losses",
        "degrees",
        2,
        "the error, in which a lost frame counts at least as much as the mean "
        "training pose",
    )
    error = replace(MEASURES["error_degrees"], name="error_degrees.mean")
    return [
        Column(loss, brief=True),
        # only in rows and the CSV: a page with 100,000 rows has no room for it
        Column(error, in_tables=False),
        *_skill_columns(),
        Column(_share("lost_rate"), brief=True),
        Column(_share("swap_rate")),
        Column(_share("unknown_rate"), optional=True),
        *_interval_columns(),
        Column(MEASURES["mpjpe_mm"]),
        Column(MEASURES["iou"], higher_is_better=True),
        Column(MEASURES["seconds_per_frame"], brief=True),
        Column(MEASURES["cpu_seconds_per_frame"]),
        Column(replace(MEASURES["evaluations"], name="evaluations_used")),
        *_baseline_columns(),
    ]


COLUMNS = {column.name: column for column in _columns()}
SCORE = Score(
    column=COLUMNS[LOSS],
    axis="error with losses in degrees",
    sentence="has an error with losses of {}",
    unit="°",
    points="°",
    paired="runs",
    caption="Mean of a method's errors with losses: a lost frame counts at least "
    "as much as the mean training pose. "
    "The line is its 95 % interval; dashed lines are baselines. In simulated studies "
    "the interval contains the true mean in 94 to 97 %, and in 88 to 91 % where a few "
    "errors are many times larger than the others.",
    leaderboard="Each figure is the mean of a method's runs. In the error with losses "
    "a lost frame counts at least as much as the mean training pose. First come the "
    "methods that are not shown to be worse than the method of the lowest error "
    "(p at least 0.05 before the correction), in order of lost tracks; then the "
    "others by their error. "
    "Skill is 1 − error with losses / baseline: 0 is no better than the baseline, "
    "which uses the true root and translation. ",
)


class Tracks:
    """The kind of runs of tracks, see `posefit.report.contest.Kind`."""

    name = "track"
    noun = "tracks"
    title = "Report of a sweep"
    columns: Mapping[str, Column] = COLUMNS
    score = SCORE
    # errors of joints (27,) in mm; modes (bins, 3), see `_binned`; evaluations and
    # costs
    data: Mapping[str, Callable[[], Store]] = MappingProxyType(
        {"joint_errors": Packed, "modes": list, "traces": Traces}
    )

    def computed(self, row: Row, /) -> dict[str, float]:
        """Return the error with losses of a row."""
        return {LOSS: error_with_losses(row)}

    def read(self, row: Row, /) -> tuple[Array, dict[str, Any]]:
        """Return the figures of a row and its other data."""
        used = np.array(row["trace"]["evaluations"], np.float32)
        trace = used, np.array(row["trace"]["cost"], np.float32)
        joints = np.array(row["joint_errors_mm"], dtype=np.float32)
        row = {**row, **self.computed(row)}
        figures = np.array([column.value(row) for column in COLUMNS.values()])
        modes = _binned(row["mode_reliability"])
        return figures, {"joint_errors": joints, "modes": modes, "traces": trace}

    def instance_order(self, fields: InstanceFields) -> tuple[Any, ...]:
        """Return the key by which instances are sorted: undamaged ones come first."""
        corruption = sorted(fields["corruption"].items())
        return (
            fields["motion"],
            fields["view_degrees"],
            len(corruption),
            corruption,
            fields["instance"],
        )

    def instance_name(self, fields: InstanceFields) -> str:
        """Return an instance's name, such as `walk, view 45°, instance 1`."""
        directions = ", ".join(f"{view}°" for view in views(fields))
        first = f"{fields['motion']}, view {directions}"
        return ", ".join([first, *damage(fields), f"instance {fields['instance']}"])

    def facts(self, runs: Runs) -> dict[str, Any]:
        """Return the facts about the runs by their titles."""
        frames = np.array(
            [fields["frames"] for fields in runs.instance_fields], dtype=int
        )
        seconds = runs.figures["seconds_per_frame"] * frames[runs.instance]
        hours = float(np.nansum(seconds) / 3600.0)
        time = f"{hours:.1f} hours" if hours >= 0.1 else f"{60 * hours:.1f} minutes"
        seeds = [*map(str, runs.seeds[:MAX_SEEDS])]
        if len(runs.seeds) > MAX_SEEDS:
            seeds.append(f"… ({len(runs.seeds):,})")
        directions = {", ".join(views(fields)) for fields in runs.instance_fields}
        corruptions = {
            ", ".join(damage(fields)) or "none" for fields in runs.instance_fields
        }
        budgets = [f"{budget:,}" for budget in runs.values("evaluations")]
        return {
            "instances": f"{len(runs.instances):,}",
            "motions": runs.values("motion"),
            "views, degrees": sorted(directions),
            "corruptions": sorted(corruptions),
            "frames": runs.values("frames"),
            "translation": runs.values("translation"),
            "seeds": seeds,
            "evaluations a frame": budgets,
            "time of the searches": time,
        }

    def tested_errors(self, contest: Contest) -> Array:
        """Return the errors with losses (methods, blocks, 1).

        A block is an instance with a seed.
        """
        return contest.scores[:, :, None]

    def figures(self, runs: Runs, rows: Indices) -> dict[str, float | None]:
        """Return the averages of some rows.

        A skill is 1 - e / b with the error with losses e and the baseline's error b.
        """
        figures = runs.averages(rows)
        for name in BASELINES:
            baseline = figures[f"baselines_degrees.{name}"]
            figures[f"skill.{name}"] = _skill(figures[LOSS], baseline)
        return figures

    def interval(self, contest: Contest, index: int) -> tuple[float, float]:
        """Return the ends of the interval of a method's mean error."""
        means = contest.means(index, contest.scores[index : index + 1])
        return float(means.low[0]), float(means.high[0])

    def baselines(self, contest: Contest) -> list[Baseline]:
        """Return the baselines, on the same runs as the methods."""
        figures = contest.runs.averages(contest.blocks.ravel())
        errors = {name: figures[f"baselines_degrees.{name}"] for name in BASELINES}
        baselines = []
        for name, title in BASELINES.items():
            skills = {}
            for other, error in errors.items():
                skills[f"skill.{other}"] = _skill(errors[name], error)
            baselines.append(Baseline(name, title, {LOSS: errors[name], **skills}))
        return baselines

    def instance_words(self, contest: Contest) -> str:
        """Return the instances of a contest in words: `4 instances of run and walk`."""
        motions = sorted(set(contest.instance_field("motion").tolist()))
        names = (
            listed(motions) if len(motions) <= MAX_NAMES else f"{len(motions)} motions"
        )
        return f"{counted(len(contest.instances), 'instance')} of {names}"

    def baseline_sentences(
        self, contest: Contest, first: int, baselines: Sequence[Baseline]
    ) -> list[str]:
        """Return a sentence that compares the best baseline with the first method."""
        known = []
        for baseline in baselines:
            if (error := baseline.figures[LOSS]) is not None:
                known.append((error, baseline.title))
        first_error = contest.runs.averages(contest.rows_of(first))[LOSS]
        if not known or first_error is None:
            return []
        error, title = min(known, key=itemgetter(0))
        if error > first_error:
            return [f"The best baseline, the {title}, has {SCORE.text(error)}."]
        return [f"It does not beat the baselines: the {title} has {SCORE.text(error)}."]

    def page(self, runs: Runs, contest: Contest | None, /) -> dict[str, Any]:
        """Return the charts, the joints, the uncertainty, the rows and the sections."""
        sections = ["rows"] if len(runs) else []
        part: dict[str, Any] = {}
        if contest is not None:
            joints = charts.joint_errors(contest)
            certainty = charts.certainty(contest)
            chart_sections = ["leaderboard", "comparison", "curves"]
            if joints:
                chart_sections.append("joints")
            if certainty:
                chart_sections.append("certainty")
            sections = [*chart_sections, *sections]
            part = {
                "pairs": _pairs(contest),
                "charts": [chart.as_dict() for chart in charts.track_charts(contest)],
                "joint_errors": [vars(intervals) for intervals in joints],
                "certainty": certainty,
            }
        rows = {
            "method": runs.method,
            "instance": runs.instance,
            "seed": runs.seed,
            **{name: runs.figures[name] for name in runs.table_figures},
            "key": runs.keys.astype(str),
        }
        return {
            **part,
            "sections": sections,
            "joints": [joint.replace("_", " ") for joint in PLACES],
            "rows": rows,
            "seeds": [*map(str, runs.seeds)],
            # a command that repeats a row consists of these, with its seed
            "command": {
                "begin": TRACK_BEGIN,
                "methods": [
                    plan_lines(track_fields(fields)) for fields in runs.variants
                ],
                "instances": [
                    plan_lines(track_fields(fields)) for fields in runs.instance_fields
                ],
                "end": END,
            },
        }


def _pairs(contest: Contest) -> dict[str, Any] | None:
    """Return the paired tests of a contest, as the page needs them.

    There are the methods, the number of blocks, and for each pair the fields of a
    `posefit.statistics.paired.PairedTest`. The result is None if there are not two
    methods and two blocks.
    """
    if not contest.comparisons:
        return None
    return {
        "methods": contest.methods,
        "blocks": contest.tested_errors[0].size,
        "pairs": [astuple(comparison) for comparison in contest.comparisons],
    }


def _binned(modes: Sequence[Sequence[float]]) -> Array:
    """Return a row's likeliest modes by bins of their probability.

    The result (bins, 3) has the number of frames, the sum of their probabilities, and
    the number of frames whose mode is right.
    """
    if not modes:
        return NO_MODES
    bins = np.zeros((BINS, 3), dtype=np.float32)
    for count, probability, right in modes:
        k = min(int(probability * BINS), BINS - 1)
        bins[k] += count * np.array([1.0, probability, right])
    return np.asarray(bins)


def _skill(error: float | None, baseline: float | None) -> float | None:
    """Return the skill over a baseline, None if either error is unknown."""
    if error is None or baseline is None:
        return None
    return skill(error, baseline)


TRACKS = Tracks()
