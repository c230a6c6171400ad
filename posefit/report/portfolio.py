"""A report's figures and tables as files for a paper."""

from pathlib import Path
from typing import Any

import numpy as np

from posefit.files import new_folder
from posefit.geometry.skeleton import JOINTS
from posefit.report import figures
from posefit.report.columns import COLUMNS, SHOWN
from posefit.report.contest import contest_of, leaderboard
from posefit.report.curves import convergence, grid, joint_errors, reached
from posefit.report.export import write_csv
from posefit.report.latex import write_latex
from posefit.report.runs import Runs
from posefit.statistics.profiles import performance_profile
from posefit.statistics.ranks import friedman

KINDS = ("png", "pdf")
LEVELS = 200  # of a performance profile
_ERROR, *_OTHERS = SHOWN
TABLE = {  # the heads of the leaderboard's columns, and what they hold
    "method": "name",
    COLUMNS[_ERROR].head: _ERROR,
    "low": "low",
    "high": "high",
    "alike": "letters",
    **{COLUMNS[name].head: name for name in _OTHERS},
    "runs": "runs",
}


def write_portfolio(runs: Runs, path: str | Path) -> None:
    """Write a new folder of figures and tables; figures that the runs do not allow are left out.

    They are convergence, attainment, profile, joints and critical-difference as PNG and PDF, and the leaderboard as
    leaderboard.tex and .csv.

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
    if len(names) > 1 and errors[0].size > 1:
        drawn["critical-difference"] = figures.critical_difference_figure(names, friedman(errors))
    rows = leaderboard(contest)
    with new_folder(path) as folder:
        for name, figure in drawn.items():
            for kind in KINDS:
                figures.save(figure, folder / f"{name}.{kind}")
        write_latex(
            list(TABLE), [[_cell(row[key]) for key in TABLE.values()] for row in rows], folder / "leaderboard.tex"
        )
        write_csv(({title: row[key] for title, key in TABLE.items()} for row in rows), folder / "leaderboard.csv")


def _cell(value: Any) -> Any:
    return float(value) if isinstance(value, np.floating) else value
