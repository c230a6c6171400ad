"""A report's figures and tables as files for a paper."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from posefit.files import new_folder
from posefit.geometry.skeleton import JOINTS
from posefit.report import figures
from posefit.report.columns import COLUMNS
from posefit.report.contest import contest_of, leaderboard
from posefit.report.curves import certainty, convergence, grid, joint_errors, reached
from posefit.report.export import write_csv
from posefit.report.latex import write_latex
from posefit.report.runs import Runs, shown_of
from posefit.statistics.profiles import performance_profile
from posefit.statistics.ranks import friedman

KINDS = ("png", "pdf")
LEVELS = 200  # of a performance profile


def write_portfolio(runs: Runs, path: str | Path) -> None:
    """Write a new folder of figures and tables; figures that the runs do not allow are left out.

    They are convergence, attainment, profile, joints, critical-difference, reliability and coverage as PNG and PDF, and
    the leaderboard as leaderboard.tex and .csv.

    Raises ValueError where no run has an error, or where the folder exists or cannot be written.
    """
    contest = contest_of(runs)
    if contest is None:
        raise ValueError("figures must be of runs with errors, got none")
    names = [runs.methods[m] for m in contest.methods]
    errors = contest.of("error")
    evaluations = grid(contest)
    drawn: dict[str, Any] = {}
    curves = [
        (name, one) for name, one in zip(names, convergence(contest, evaluations), strict=True) if one is not None
    ]
    if curves:
        drawn["convergence"] = figures.curves_figure(
            [name for name, _ in curves], evaluations, [one for _, one in curves]
        )
        drawn["attainment"] = figures.attainment_figure(names, evaluations, reached(contest, evaluations))
    levels = np.linspace(0.0, float(errors.max()), LEVELS)
    drawn["profile"] = figures.profile_figure(names, levels, performance_profile(errors, levels))
    if joints := joint_errors(contest):
        drawn["joints"] = figures.joint_errors_figure(names, JOINTS, joints)
    if contest.testable:
        ranking = friedman(contest.errors_of_blocks())
        drawn["critical-difference"] = figures.critical_difference_figure(names, ranking)
    drawn |= _certain(names, certainty(contest))
    rows, table = leaderboard(contest), _table(runs)
    with new_folder(path) as folder:
        for name, figure in drawn.items():
            for kind in KINDS:
                figures.save(figure, folder / f"{name}.{kind}")
        write_latex(
            list(table), [[_cell(row[key]) for key in table.values()] for row in rows], folder / "leaderboard.tex"
        )
        write_csv(({title: row[key] for title, key in table.items()} for row in rows), folder / "leaderboard.csv")


def _table(runs: Runs) -> dict[str, str]:
    """Return the heads of the leaderboard's columns, and what they hold."""
    error, *others = shown_of(runs)
    return {
        "method": "name",
        COLUMNS[error].head: error,
        "low": "low",
        "high": "high",
        "alike": "letters",
        **{COLUMNS[name].head: name for name in others},
        "runs": "runs",
    }


def _certain(names: Sequence[str], found: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the figures of how sure methods say they are, as far as they say it."""
    each = [] if found is None else found["methods"]
    drawn = {}
    bins = [(name, one["reliability"]) for name, one in zip(names, each, strict=False) if one and one["reliability"]]
    if bins:
        drawn["reliability"] = figures.reliability_figure([name for name, _ in bins], [one for _, one in bins])
    told = [(name, one) for name, one in zip(names, each, strict=False) if one and None not in one["coverage"]]
    if told and found is not None:
        widths, shares = ([one[kind] for _, one in told] for kind in ("width", "coverage"))
        drawn["coverage"] = figures.coverage_figure([name for name, _ in told], found["levels"], widths, shares)
    return drawn


def _cell(value: Any) -> Any:
    return float(value) if isinstance(value, np.floating) else value
