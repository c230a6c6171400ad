"""Runs for other tools: IOHprofiler's folders, rows as CSV, and tables as LaTeX that needs no package.

IOHprofiler: Doerr et al., IOHprofiler, 2018; the layout is that of IOHexperimenter's Analyzer logger. Readers: the
library iohinspector, the web page IOHanalyzer.
"""

import csv
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from posefit.errors import InputError
from posefit.files import new_file, new_folder
from posefit.statistics.profiles import Trace
from posefit.suites.functions import suite_function
from posefit.suites.running import SuiteRun, budgets_differ
from posefit.version import __version__

FORMAT = "0.3.18"  # the IOHexperimenter that the layout is of
SUITE = "posefit"
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


def write_iohprofiler(runs: Sequence[SuiteRun], path: str | Path) -> None:
    """Write a new folder `path` with a folder a method and, in it, a .json and a data folder a function.

    A method with other settings is another algorithm: its settings are in its `info`, and numbered in its name if there
    are several. They include the way with infeasible proposals and, where a dimension has several, the budget. A row is
    written wherever the cost falls, and at a run's end. Readers separate runs by evaluation 1: a trace that starts
    later, such as after a whole population, has `inf` in that row. Raises ValueError where a run comes twice, and where
    the folder exists or cannot be written.
    """
    algorithms: dict[tuple[str, str], dict[Any, SuiteRun]] = {}
    several = budgets_differ(runs)
    for run in runs:
        # names of several words, which no optimiser's setting has
        budget = {"evaluations for each dimension": run.budget / run.dimension} if several else {}
        looks = {"looks at the silhouette": True} if run.looked else {}
        settings = {**run.settings, "infeasible proposals": run.infeasible, **budget, **looks}
        logged = algorithms.setdefault((run.method, json.dumps(settings, sort_keys=True, default=str)), {})
        place = run.function, run.dimension, run.instance, run.seed
        if place in logged:
            raise InputError(f"runs must differ, got two of {run.method} on {run.suite}, {place}: f, d, instance, seed")
        logged[place] = run
    algorithms = dict(sorted(algorithms.items()))
    methods = [method for method, _ in algorithms]
    numbers = [methods[: k + 1].count(method) for k, method in enumerate(methods)]
    names = [
        f"{method} #{number}" if methods.count(method) > 1 else method
        for method, number in zip(methods, numbers, strict=True)
    ]
    with new_folder(path) as folder:
        for (_, info), name, file_name, logged in zip(
            algorithms, names, _file_names(names), algorithms.values(), strict=True
        ):
            for _, here in groupby([logged[key] for key in sorted(logged)], key=lambda run: run.function):
                _write_function(folder / file_name, {"name": name, "info": info}, list(here))


def _write_function(folder: Path, algorithm: Mapping[str, str], runs: list[SuiteRun]) -> None:
    """Write the runs on one function, which are sorted."""
    function = suite_function(runs[0].function)
    name = f"f{function.number}_{function.name.replace(' ', '-')}"
    data = folder / f"data_{name}"
    data.mkdir(parents=True)
    scenarios = []
    for dimension, here in groupby(runs, key=lambda run: run.dimension):
        path, entries = data / f"IOHprofiler_f{function.number}_DIM{dimension}.dat", []
        with path.open("w", encoding="ascii", newline="\n") as file:
            for run in here:
                used, best = _rows((run.evaluations, run.costs))
                file.write(_HEADER + "\n")
                file.writelines(f"{e} {y!r}\n" for e, y in zip(used, best, strict=True))
                least = {"evals": used[best.index(best[-1])], "y": best[-1], "x": []}
                entries.append({"instance": run.instance, "evals": used[-1], "best": least, "seed": run.seed})
        scenarios.append({"dimension": dimension, "path": f"{data.name}/{path.name}", "runs": entries})
    summary = {
        "version": FORMAT,
        "suite": SUITE,
        "function_id": function.number,
        "function_name": function.name,
        "maximization": False,
        "algorithm": algorithm,
        # iohinspector evaluates what stands here as Python: nothing that a user or a plugin wrote
        "experiment_attributes": [{"posefit": __version__}],
        "attributes": _HEADER.split(),
        "run_attributes": ["seed"],
        "scenarios": scenarios,
    }
    (folder / f"IOHprofiler_{name}.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")


def _rows(run: Trace) -> tuple[list[int], list[float]]:
    """Return evaluations and costs from evaluation 1 on, wherever the cost falls, and at the end."""
    used, best = run
    if used[0] > 1.0:
        used, best = np.append(1.0, used), np.append(np.inf, best)
    written = np.append(True, np.diff(best) < 0.0)
    written[-1] = True
    return used[written].astype(int).tolist(), best[written].tolist()


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
