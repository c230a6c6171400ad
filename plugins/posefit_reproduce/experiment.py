"""An experiment: stored runs, and the tables, claims and figures made from them.

A run gives named arrays. Each run is a file in `runs/` of the folder, so that the same
command continues where it was interrupted. Every table is a Markdown file, from which
pages are made.
"""

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import partial
from math import nan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, NamedTuple

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.cli.output import say
from posefit.errors import InputError
from posefit.files import new_file
from posefit.output.identity import difference, digest_of
from posefit.reading import parsed_json, read_text
from posefit.statistics.means import Mean, mean_interval
from posefit.version import posefit_build
from posefit_reproduce.jobs import Progress, each

RECORD = "runs.json"
MAX_RECORD_BYTES = 100_000
# confidence of an interval; in a table of claims, of all intervals together
LEVEL = 0.95
Arrays = Mapping[str, Any]
Verdict = Literal["holds", "fails", "not decided"]


class Run(NamedTuple):
    """Identifies a run."""

    kind: str  # one kind of an experiment's runs, such as "track"
    subject: str  # the motion or film
    method: str
    view: float = 0.0  # degrees
    seed: int = 0

    @property
    def file(self) -> str:
        """The name of the run's file."""
        parts = []
        for part in self:
            parts.append(f"{part:g}" if isinstance(part, float) else str(part))
        return re.sub(r"[^\w.+-]+", "_", "-".join(parts))


@dataclass(frozen=True)
class Results:
    """The arrays of all runs."""

    runs: Mapping[Run, Arrays]

    def of(self, name: str, kind: str, subject: str, method: str) -> Array:
        """Return a named array of all runs of a method: (views, seeds, ...)."""
        rows = {}
        for run, arrays in self.runs.items():
            if (run.kind, run.subject, run.method) == (kind, subject, method):
                rows[run.view, run.seed] = arrays[name]
        views = sorted({view for view, _ in rows})
        seeds = sorted({seed for _, seed in rows})
        table = []
        for view in views:
            table.append([rows[view, seed] for seed in seeds])
        return np.array(table)

    def views(self, kind: str) -> list[float]:
        """Return the views of the runs of a kind, in order."""
        views = set()
        for run in self.runs:
            if run.kind == kind:
                views.add(run.view)
        return sorted(views)

    def has(self, kind: str, subject: str, method: str) -> bool:
        """Return whether a run of this kind, subject and method exists."""
        return any(run[:3] == (kind, subject, method) for run in self.runs)


class Table(NamedTuple):
    """A table of text. Its first columns, `words` of them, are left-aligned."""

    name: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    words: int = 1

    def __str__(self) -> str:
        """The table in Markdown."""
        rule = "|" + "---|" * self.words + "---:|" * (len(self.heads) - self.words)
        lines = [_line(self.heads), rule, *map(_line, self.rows)]
        return "\n".join(lines)


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


class Claim(NamedTuple):
    """The statement that a mean is below a bound, or above it.

    `subject` is the motion or method on which it is tested. Claims with the same text
    form one row of a table, with a column for each subject. `values` (strata, seeds)
    are paired differences, or figures of runs; a single number is a fact without
    chance.
    """

    text: str
    source: str
    subject: str
    values: Array
    unit: str = "degrees"
    bound: float = 0.0
    above: bool = False

    def verdict(self, level: float) -> tuple[Verdict, Mean]:
        """Return the verdict and the interval at a confidence level.

        Without an interval the verdict is "not decided".
        """
        mean = interval(self.values, level)
        lower = mean.high < self.bound
        higher = mean.low > self.bound
        if lower or higher:
            return "holds" if higher == self.above else "fails", mean
        return "not decided", mean


def interval(values: Array, level: float = LEVEL) -> Mean:
    """Return the mean of values (strata, seeds) with an interval over seeds.

    The interval of a single number is the number itself.
    """
    if values.ndim == 0:
        return Mean(float(values), float(values), float(values))
    strata, seeds = np.indices(values.shape)
    # one seed says nothing about others
    if values.shape[1] < 2:
        return Mean(float(values.mean()), nan, nan)
    return mean_interval(values.ravel(), strata.ravel(), seeds.ravel(), level=level)


def claims_table(name: str, claims: Sequence[Claim]) -> Table:
    """Return claims with their verdicts, with a column for each subject.

    The claim with the most subjects gives their order. All intervals hold together at
    the level: Bonferroni's correction.
    """
    texts: dict[str, dict[str, Claim]] = {}
    uncertain = 0
    for claim in claims:
        texts.setdefault(claim.text, {})[claim.subject] = claim
        # facts without chance need no share of the error
        uncertain += claim.values.ndim > 0
    level = 1.0 - (1.0 - LEVEL) / max(uncertain, 1)
    subjects = [*max(texts.values(), key=len)]
    rows = []
    for text, by_subject in texts.items():
        cells = dict.fromkeys(subjects, "")
        bounds: dict[str, None] = {}  # an ordered set
        for subject, claim in by_subject.items():
            verdict, mean = claim.verdict(level)
            cells[subject] = f"**{verdict}** {bounded(mean)}"
            bounds[f"{claim.bound:.3g}"] = None
        # claims with the same text share source, unit, direction and number of runs
        *_, last = by_subject.values()
        count = str(last.values.size) if last.values.ndim else "-"
        side = "above" if last.above else "below"
        condition = f"{side} {' / '.join(bounds)} {last.unit}"
        rows.append([text, last.source, condition, count, *cells.values()])
    return Table(name, ["claim", "where", "holds if", "n", *subjects], rows, 3)


def formatted(values: Iterable[float], digits: int) -> list[str]:
    """Return the text of each number."""
    return [f"{value:.{digits}f}" for value in values]


def bounded(mean: Mean, digits: int = 2) -> str:
    """Return a mean with its interval."""
    if np.isnan(mean.low) or mean.low == mean.high:
        return f"{mean.value:.{digits}f}"
    return f"{mean.value:.{digits}f} ({mean.low:.{digits}f} to {mean.high:.{digits}f})"


@dataclass(frozen=True)
class Experiment:
    """The runs of an experiment, and how to make tables and figures from them."""

    runs: Sequence[Run]
    perform: Callable[[Run], Arrays]
    tables: Callable[[Results], Iterable[Table]]
    # file names with matplotlib's figures or images
    figures: Callable[[Results], Iterable[tuple[str, Any]]]
    # what all runs depend on, besides their names
    shared: Mapping[str, Any] = field(default_factory=dict)


def reproduce(
    experiment: Experiment,
    out: str | Path | None,
    workers: int,
    progress: Progress | None,
) -> list[Table]:
    """Return the tables of an experiment.

    With a folder, tables and figures are also written there, and runs that it already
    contains are not repeated.

    Args:
        experiment: The experiment.
        out: The folder, or None.
        workers: Number of processes.
        progress: Shows the progress of the runs, or None.

    Raises:
        InputError: If the folder cannot be written, has other content, or contains runs
            made under other conditions.
        ImportError: If the library that draws figures is not installed.
    """
    if out is not None:
        from posefit.report.figures import empty_figure

        # fails now rather than after hours of runs
        empty_figure()
    with nullcontext(out) if out is not None else TemporaryDirectory() as place:
        folder = Path(place)
        _make_runs_folder(folder)
        files = {run: folder / "runs" / f"{run.file}.npz" for run in experiment.runs}
        jobs = {}
        for run, file in files.items():
            if not file.exists():
                jobs[run] = partial(_store, experiment.perform, run, file)
        _check_record(folder, experiment.shared, bool(jobs))
        if jobs:
            each(jobs, workers, progress)
        results = Results({run: _stored(file) for run, file in files.items()})
        tables = list(experiment.tables(results))
        if out is not None:
            for table in tables:
                (folder / f"{table.name}.md").write_text(f"{table}\n", encoding="utf-8")
            for name, figure in experiment.figures(results):
                if isinstance(figure, np.ndarray):
                    (folder / name).write_bytes(
                        cv2.imencode(Path(name).suffix, figure)[1].tobytes()
                    )
                else:
                    figure.savefig(folder / name, dpi=130)
    return tables


def _make_runs_folder(folder: Path) -> None:
    """Make the folder of runs. Raises InputError if the folder has other content."""
    try:
        if folder.is_dir() and any(folder.iterdir()) and not (folder / "runs").is_dir():
            raise InputError(
                f"{folder}: the folder contains something else: choose a new folder, "
                "or one of an earlier reproduction"
            )
        (folder / "runs").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{folder}: cannot write to this folder: {error.strerror}"
        ) from error


def _check_record(folder: Path, shared: Mapping[str, Any], adding: bool) -> None:
    """Check the record of the conditions under which a folder's runs were made.

    Write the record if there are no runs yet.

    The build of posefit counts only if runs are added to others. Raises InputError if
    the record differs.
    """
    file = folder / RECORD
    conditions = {**shared, "build": posefit_build()}
    now = {name: digest_of(value) for name, value in conditions.items()}
    if not file.exists():
        if any((folder / "runs").iterdir()):
            say(
                f"warning: {file} is missing: "
                "cannot check that the earlier runs were made under the same conditions"
            )
        else:
            file.write_text(json.dumps(now, indent=1) + "\n", encoding="utf-8")
        return
    try:
        before = parsed_json(read_text(file, MAX_RECORD_BYTES))
    except ValueError:
        before = None
    is_record = isinstance(before, dict)
    if is_record:
        is_record = all(isinstance(value, dict) for value in before.values())
    if not is_record:
        raise InputError(
            f"{file}: not a record of the conditions of runs: choose another folder"
        )
    # tables may be made again with a newer build, but runs of two builds are not mixed
    if not adding:
        before.pop("build", None)
        now.pop("build")
    if changed := difference(before, now):
        raise InputError(f"{folder}: {changed}")


def _store(perform: Callable[[Run], Arrays], run: Run, file: Path) -> Path:
    """Write the arrays of a run, and return their file."""
    arrays = perform(run)
    with new_file(file) as building:
        np.savez_compressed(building, build=posefit_build(), **arrays)
    return file


def _stored(file: Path) -> Arrays:
    with np.load(file) as stored:
        return dict(stored)
