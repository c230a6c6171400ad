"""Runs for other tools: IOHprofiler's and COCO's folders, rows as CSV, and tables as LaTeX that needs no package.

IOHprofiler: Doerr et al., IOHprofiler, 2018; the layout is that of IOHexperimenter's Analyzer logger. Readers: the
library iohinspector, the web page IOHanalyzer. COCO: Hansen et al., 2021; reader: the library cocopp.
"""

import csv
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from posefit.errors import InputError
from posefit.files import new_file, new_folder
from posefit.geometry.skeleton import ANGLES
from posefit.report.tracks import damage, views
from posefit.statistics.profiles import Trace
from posefit.suites.functions import suite_function
from posefit.suites.running import SuiteRun, budgets_differ, method_name
from posefit.version import __version__

if TYPE_CHECKING:
    from posefit.sweep.ledger import Ledger

FORMAT = "0.3.18"  # the IOHexperimenter that the layout is of
SUITE = "posefit"
MAX_NUMBER = 2**16 - 1  # of an instance or a dimension, as iohinspector holds it
_HEADER = "evaluations raw_y"
_SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "[": "{[}",  # else a row's first cell could be read as an argument of the line break before it
    "]": "{]}",
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
}


@dataclass(frozen=True, eq=False)
class LoggedRun:
    """One run of a method on an instance of a problem."""

    method: str
    settings: Mapping[str, Any]
    problem: str
    dimension: int
    instance: int
    seed: int
    evaluations: ArrayLike = field(repr=False)  # (k,), rising
    costs: ArrayLike = field(repr=False)  # (k,), the best so far


def logged_runs(ledger: "Ledger") -> Iterator[LoggedRun]:
    """Yield the runs of a ledger of tracks that have a trace."""
    for row in ledger.rows():
        spec, trace = row["spec"], row["trace"]
        if not trace["evaluations"]:
            continue
        footage = spec["motion"], "view", *views(spec), *damage(spec)
        conditions = *footage, "frames", spec["frames"], spec["translation"]
        more = {name: spec[name] for name in ("evaluations", "hypotheses", "version")}
        yield LoggedRun(
            spec["method"],
            {**spec["settings"], **more},
            " ".join(map(str, conditions)),
            row.get("dimensions") or ANGLES,  # a tracker without a search space has the pose's dimension
            spec["instance"],
            spec["seed"],
            trace["evaluations"],
            trace["cost"],
        )


def suite_runs(runs: Sequence[SuiteRun]) -> Iterator[LoggedRun]:
    """Yield runs on a suite, whose settings include their way with infeasible proposals.

    Where a dimension has several budgets, they include that, too. Both have names of several words, which no
    optimiser's setting has.
    """
    several = budgets_differ(runs)
    for run in runs:
        budget = {"evaluations for each dimension": run.budget / run.dimension} if several else {}
        settings = {**run.settings, "infeasible proposals": run.infeasible, **budget}
        name = f"f{run.function} {suite_function(run.function).name}"
        yield LoggedRun(run.method, settings, name, run.dimension, run.instance, run.seed, run.evaluations, run.costs)


def write_iohprofiler(runs: Iterable[LoggedRun], path: str | Path) -> None:
    """Write a new folder `path` with a folder a method and, in it, a .json and a data folder a problem.

    A method with other settings is another algorithm: its settings are in its `info`, and numbered in its name if there
    are several. Problems are numbered in the order of their names. A row is written wherever the cost falls, and at a
    run's end. Readers separate runs by evaluation 1: a trace that starts later, such as after a whole population, has
    `inf` in that row. Raises ValueError where a run is invalid or comes twice, and where the folder exists or cannot be
    written.
    """
    algorithms = _grouped(runs)
    methods = [method for method, _ in algorithms]
    numbers = [methods[: k + 1].count(method) for k, method in enumerate(methods)]
    names = [
        f"{method} #{number}" if methods.count(method) > 1 else method
        for method, number in zip(methods, numbers, strict=True)
    ]
    problems = sorted({run.problem for runs in algorithms.values() for run in runs})
    with new_folder(path) as folder:
        for (_, info), name, place, own in zip(algorithms, names, _file_names(names), algorithms.values(), strict=True):
            for number, (problem, file_name) in enumerate(zip(problems, _file_names(problems), strict=True), 1):
                if here := [run for run in own if run.problem == problem]:
                    _write_problem(folder / place, f"f{number}_{file_name}", number, {"name": name, "info": info}, here)


def _write_problem(folder: Path, name: str, number: int, algorithm: Mapping[str, str], runs: list[LoggedRun]) -> None:
    data = folder / f"data_{name}"
    data.mkdir(parents=True)
    scenarios = []
    for dimension in sorted({run.dimension for run in runs}):
        path = data / f"IOHprofiler_f{number}_DIM{dimension}.dat"
        entries = []
        with path.open("w", encoding="ascii", newline="\n") as file:
            for run in sorted(runs, key=lambda run: (run.instance, run.seed)):
                if run.dimension != dimension:
                    continue
                used, best = _rows((np.asarray(run.evaluations, float), np.asarray(run.costs, float)))
                file.write(_HEADER + "\n")
                file.writelines(f"{e} {y!r}\n" for e, y in zip(used, best, strict=True))
                least = {"evals": used[best.index(best[-1])], "y": best[-1], "x": []}
                entries.append({"instance": run.instance, "evals": used[-1], "best": least, "seed": run.seed})
        scenarios.append({"dimension": dimension, "path": f"{data.name}/{path.name}", "runs": entries})
    summary = {
        "version": FORMAT,
        "suite": SUITE,
        "function_id": number,
        "function_name": runs[0].problem,
        "maximization": False,
        "algorithm": algorithm,
        # iohinspector evaluates what stands here as Python: nothing that a user or a plugin wrote
        "experiment_attributes": [{"posefit": __version__}],
        "attributes": _HEADER.split(),
        "run_attributes": ["seed"],
        "scenarios": scenarios,
    }
    (folder / f"IOHprofiler_{name}.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")


def write_coco(runs: Iterable[SuiteRun], path: str | Path) -> None:
    """Write a new folder `path` with a folder a method, as COCO's logger of bbob has them; its reader is cocopp.

    Costs are above the true pose's, and at least 0. A run's way with infeasible proposals and its budget are not
    distinguished. Raises ValueError where the folder exists or cannot be written.
    """
    groups: dict[str, list[SuiteRun]] = {}
    for run in sorted(runs, key=lambda run: (run.function, run.dimension, run.instance, run.seed)):
        groups.setdefault(method_name(run), []).append(run)
    with new_folder(path) as folder:
        for (name, own), place in zip(groups.items(), _file_names(list(groups)), strict=True):
            for (number, dimension), here in groupby(own, key=lambda run: (run.function, run.dimension)):
                data = folder / place / f"data_f{number}"
                data.mkdir(parents=True, exist_ok=True)
                stem, text, ends = data / f"bbobexp_f{number}_DIM{dimension}", "", ""
                for run in here:
                    text += f"% f evaluations | g evaluations | best cost above the true pose's, {run.truth_cost!r}\n"
                    used, best = _rows((run.evaluations, run.costs - run.truth_cost))
                    text += "".join(f"{e} 0 {max(y, 0.0):+.9e}\n" for e, y in zip(used, best, strict=True))
                    ends += f", {run.instance}:{used[-1]}|{max(best[-1], 0.0):.1e}"
                for ending in (".dat", ".tdat"):  # by costs and by evaluations: here the same rows
                    stem.with_suffix(ending).write_text(text, encoding="ascii")
                with (folder / place / f"bbobexp_f{number}.info").open("a", encoding="utf-8") as info:
                    info.write(
                        f"suite = 'bbob', funcId = {number}, DIM = {dimension}, Precision = 1.000e-08, "
                        f"algId = '{name}', coco_version = '2.8', logger = 'bbob', data_format = 'bbob-new2'\n"
                        f"% {run.suite}\ndata_f{number}/{stem.name}.dat{ends}\n"
                    )


def _rows(run: Trace) -> tuple[list[int], list[float]]:
    """Return evaluations and costs from evaluation 1 on, wherever the cost falls, and at the end."""
    used, best = run
    if used[0] > 1.0:
        used, best = np.append(1.0, used), np.append(np.inf, best)
    written = np.append(True, np.diff(best) < 0.0)
    written[-1] = True
    return used[written].astype(int).tolist(), best[written].tolist()


def _grouped(runs: Iterable[LoggedRun]) -> dict[tuple[str, str], list[LoggedRun]]:
    """Return the checked runs of each (method, settings as JSON), in the order of both."""
    groups: dict[tuple[str, str], list[LoggedRun]] = {}
    identities = set()
    for run in runs:
        name = f"{run.method} on {run.problem}, instance {run.instance}, seed {run.seed}"
        for kind, value, least in (("dimension", run.dimension, 1), ("instance", run.instance, 0)):
            if not least <= value <= MAX_NUMBER:
                raise InputError(f"{name}: {kind} must lie in {least} to {MAX_NUMBER}, got {value}")
        key = run.method, json.dumps(dict(run.settings), sort_keys=True, default=str)
        identity = (*key, run.problem, run.dimension, run.instance, run.seed)
        if identity in identities:
            raise InputError(f"runs must differ in method, settings, problem, instance or seed, got two of {name}")
        identities.add(identity)
        groups.setdefault(key, []).append(run)
    if not groups:
        raise InputError("runs must be at least one, got none")
    return dict(sorted(groups.items()))


def _file_names(names: list[str]) -> list[str]:
    """Return distinct names that every file system accepts, even where case does not count."""
    file_names: dict[str, str] = {}  # by their lower case
    for name in names:
        unique = plain = re.sub(r"[^A-Za-z0-9@+=#_-]+", "-", name).strip("-")[:80] or "unnamed"
        k = 2
        while unique.lower() in file_names:
            k, unique = k + 1, f"{plain}-{k}"
        file_names[unique.lower()] = unique
    return list(file_names.values())


def write_csv(rows: Iterable[Mapping[str, Any]], path: str | Path) -> None:
    """Write rows as a new CSV file, in UTF-8; columns are all that any row has, in the order of their first row.

    Missing values are left empty. Raises ValueError where there is no row, and where the file exists or cannot be
    written.
    """
    table = list(rows)
    if not table:
        raise InputError("rows must be at least one, got none")
    with new_file(path) as building, building.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(dict.fromkeys(name for row in table for name in row)), restval="")
        writer.writeheader()
        writer.writerows(table)


def latex(text: str) -> str:
    """Return text that LaTeX sets as it stands, on one line."""
    return "".join(_SPECIAL.get(letter, letter) for letter in " ".join(text.split()))


def latex_table(header: Sequence[str], rows: Sequence[Sequence[str | float | None]]) -> str:
    """Return a tabular: text to the left, numbers to the right with two digits, None and nan as dashes."""
    columns = "".join(
        "l" if any(isinstance(cell, str) for cell in column) else "r" for column in zip(*rows, strict=True)
    )
    lines = [" & ".join(map(_cell, row)) + r" \\" for row in (header, *rows)]
    rule = r"\hline"
    table = [f"\\begin{{tabular}}{{{columns}}}", rule, lines[0], rule, *lines[1:], rule, r"\end{tabular}", ""]
    return "\n".join(table)


def _cell(value: str | float | None) -> str:
    if isinstance(value, str):
        return latex(value)
    if value is None or math.isnan(value):
        return "--"
    return str(value) if isinstance(value, int) else f"{value:.2f}"
