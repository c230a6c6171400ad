"""A plan of single searches becomes cells, all checked before anything runs."""

from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

from posefit import settings
from posefit.entries import PROJECT
from posefit.fitting.check import one_of, whole
from posefit.reading import parsed_toml, quoted
from posefit.registry import registry
from posefit.suites.functions import DIMENSIONS, FUNCTIONS, HELD_OUT, SUITES, checked_address, suite_function
from posefit.suites.problem import EVALUATIONS, INFEASIBLE
from posefit.sweep.plan import MOST, Plan, plan_text
from posefit.sweep.single.search import SearchCell
from posefit.version import __version__

KEYS = ("suite", "methods", "functions", "dimensions", "instances", "budgets", "seeds", "infeasible")


def read_plan(path: str | Path) -> Plan | list[SearchCell]:
    """Return the plan of a file, as `Plan.read` does; or the cells of one that names a suite."""
    text = plan_text(path)
    try:
        tables = parsed_toml(text)
        return search_cells(tables) if "suite" in tables else Plan.of(tables)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def search_cells(tables: Mapping[str, Any]) -> list[SearchCell]:
    """Return the cells of a plan of single searches; see `posefit.sweep.single`.

    A dimension that a function has not is passed over. Raises ValueError where anything is wrong or no cell is left,
    and ImportError where an optimiser needs a library that is not installed.
    """
    for name in tables:
        if name not in KEYS:
            raise ValueError(f"a plan of a suite must hold {', '.join(KEYS)}, got {quoted(name)}")
    suite = tables["suite"]
    one_of("suite", suite, SUITES)
    infeasible = tables.get("infeasible", INFEASIBLE[0])
    one_of("infeasible", infeasible, INFEASIBLE)
    methods = [_method(one) for one in _listed("methods", tables.get("methods"))]
    functions = [
        suite_function(one) for one in _listed("functions", tables.get("functions", [f.number for f in FUNCTIONS]))
    ]
    dimensions = _listed("dimensions", tables.get("dimensions", [9]))
    for dimension in dimensions:
        one_of("dimensions", dimension, DIMENSIONS)
    instances = _numbers("instances", tables.get("instances", 15), HELD_OUT.start)
    budgets = [whole("budgets", one, 1) for one in _listed("budgets", tables.get("budgets", [EVALUATIONS]))]
    seeds = [whole("seeds", one, 0) for one in _numbers("seeds", tables.get("seeds", 1), 0)]
    lists = (dimensions, functions, instances, seeds, budgets, methods)
    count = 1
    for one in lists:
        count *= len(one)
    if count > MOST:
        raise ValueError(f"a plan must hold at most {MOST:,} cells, got {count:,}")
    cells = []
    for dimension, function, instance, seed, budget, (method, chosen, version) in product(*lists):
        if dimension in function.dimensions:
            number, instance, dimension = checked_address(suite, function.number, instance, dimension)
            evaluations = budget * dimension
            _check_population(method, chosen, evaluations)
            cells.append(
                SearchCell(method, suite, number, dimension, instance, evaluations, chosen, infeasible, seed, version)
            )
    if not cells:
        raise ValueError(f"a plan must hold at least one cell, got none in {list(dimensions)} dimensions")
    if len({cell.key for cell in cells}) < len(cells):
        raise ValueError("the cells of a plan must differ, got one twice")
    return cells


def _method(value: Any) -> tuple[str, dict[str, Any], str]:
    """Return an optimiser's name, its settings, and the versions that its results are of."""
    table = dict(value) if isinstance(value, Mapping) else {"method": value}
    for name in table:
        if name not in ("method", "settings"):
            raise ValueError(f"an entry of methods must hold method and settings, got {quoted(name)}")
    method, chosen = table.get("method"), table.get("settings", {})
    if not isinstance(method, str) or not isinstance(chosen, Mapping):
        raise ValueError(f"an entry of methods must be a name, or a table of a name and settings, got {quoted(value)}")
    offer = registry().offer("optimiser", method)
    settings.check(method, offer.factory, chosen)
    foreign = [] if offer.distribution == PROJECT else [offer.origin]
    return method, dict(chosen), ", ".join([__version__, *foreign])


def _check_population(method: str, chosen: Mapping[str, Any], evaluations: int) -> None:
    size = settings.population(registry().optimiser(method), chosen, evaluations)
    if size > evaluations:
        raise ValueError(f"evaluations must hold one population of {size}, got {evaluations} of {method}")


def _listed(name: str, values: Any) -> list[Any]:
    if not isinstance(values, list | tuple) or not values:
        raise ValueError(f"{name} must be a list of at least one, got {quoted(values)}")
    return list(values)


def _numbers(name: str, values: Any, first: int) -> list[Any]:
    """Return the numbers of a list, or so many from the first on."""
    if isinstance(values, int) and not isinstance(values, bool):
        if not 1 <= values <= MOST:
            raise ValueError(f"{name} must be a list, or a whole number from 1 to {MOST:,}, got {quoted(values)}")
        return list(range(first, first + values))
    return _listed(name, values)


def search_line(cell: SearchCell, done: bool) -> str:
    """Return the line that shows a cell of a preview."""
    told = "".join(f", {name}={value}" for name, value in sorted(cell.settings.items()))
    return f"{cell.key[:8]}  {cell}, {cell.evaluations} evaluations{told}{'  done' if done else ''}"
