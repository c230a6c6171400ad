"""Single searches as files of COCO, which its post-processing `cocopp` reads.

Each method has a folder, because cocopp names a method after its folder. Costs are
written as differences from the cost of the true pose.

Hansen et al., COCO: a platform for comparing continuous optimizers in a black-box
setting, 2021.
"""

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from posefit.files import new_folder
from posefit.report.contest import Runs
from posefit.suites.problem import TARGETS
from posefit.suites.running import SuiteRun

# COCO's logger writes two files for each run: one with a row for each target that is
# reached, one with a row at certain evaluations. Here both have a row for every
# improvement.
FILES = (".dat", ".tdat")
FORMAT = "bbob-new2"  # the columns of `_rows`


def write_coco(runs: Runs, path: str | Path) -> None:
    """Write a new folder of COCO's files, with a folder for each method.

    Args:
        runs: The runs of a ledger of single searches.
        path: The folder.

    Raises:
        InputError: The path exists, or cannot be written.
    """
    groups: dict[tuple[int, int, int], list[SuiteRun]] = {}
    for method, run in zip(runs.method.tolist(), runs.data["runs"], strict=True):
        key = (method, run.function, run.dimension)
        groups.setdefault(key, []).append(run)
    names = folder_names(runs.methods)
    with new_folder(path) as building:
        for (method, function, dimension), group in sorted(groups.items()):
            folder = building / names[method]
            folder.mkdir(exist_ok=True)
            stem = f"f{function}_DIM{dimension}"
            for ending in FILES:
                text = "".join(map(_rows, group))
                (folder / f"{stem}{ending}").write_text(text, encoding="ascii")
            with (folder / f"f{function}.info").open("a", encoding="utf-8") as info:
                info.write(_index(names[method], f"{stem}.dat", group))


def folder_names(methods: Iterable[str]) -> list[str]:
    """Return a distinct name of a folder for each method.

    >>> folder_names(["cma", "pso (population_size 20)", "pso [population_size 20]"])
    ['cma', 'pso_population_size_20', 'pso_population_size_20-2']
    """
    names: list[str] = []
    for method in methods:
        plain = re.sub(r"[^A-Za-z0-9.@=-]+", "_", method).strip("_.") or "method"
        name = plain
        number = 2
        while name in names:
            name = f"{plain}-{number}"
            number += 1
        names.append(name)
    return names


def _index(name: str, file: str, group: Sequence[SuiteRun]) -> str:
    """Return the entry of an .info file: what was run, and how each run ended."""
    first = group[0]
    ends = []
    for run in group:
        used = int(run.evaluations[-1])
        ends.append(f"{run.instance}:{used}|{_above_truth(run, run.cost):.1e}")
    return (
        f"suite = '{first.suite}', funcId = {first.function}, DIM = {first.dimension}, "
        f"Precision = {TARGETS[-1]:.3e}, algId = '{name}', coco_version = '2.8', "
        f"logger = 'bbob', data_format = '{FORMAT}'\n"
        f"% at most {first.budget} evaluations\n"
        f"{file}, {', '.join(ends)}\n"
    )


def _rows(run: SuiteRun) -> str:
    """Return the rows of a run: evaluations, constraint evaluations (0), best cost."""
    lines = ["% f evaluations | g evaluations | best cost above the true pose's\n"]
    for used, cost in zip(run.evaluations, run.costs, strict=True):
        lines.append(f"{int(used)} 0 {_above_truth(run, cost):+.9e}\n")
    return "".join(lines)


def _above_truth(run: SuiteRun, cost: float) -> float:
    # a search of function 8 may find a lower cost than the true pose's
    return max(float(cost) - run.truth_cost, 0.0)
