"""A plan: which cells a sweep consists of, all checked before anything runs.

    [defaults]                                  # what holds for every cell that says nothing else
    frames = 30
    settings = { sapso.cooling = 0.9 }          # of the methods that use them

    [product]                                   # every combination of
    methods = ["sapso@pca", "cma@full", { method = "sapso@loose", name = "cold", settings = { sapso.cooling = 0.8 } }]
    motions = ["walk", "walk-a", { motion = "16_17.amc", train = ["16_15.amc"] }]
    views = [45, [0, 90]]                       # degrees; several for several cameras
    corruptions = [{}, { holes = 0.3, dropped = 0.1 }]
    instances = 3                               # 0, 1, 2; or a list
    seeds = [0, 1, 2, 3, 4]

    [grid]                                      # the product's methods with every combination of these settings
    "sapso.inertia" = [0.7, 0.9]

    [[cells]]                                   # and these
    method = "random@pca"
    motion = "run"

An entry of a list of the product is the value of a cell's field, or a table of several fields. See
`posefit.sweep.cell.TrackCell` for what the fields are; `name` is what reports call the method.

A plan that names a suite is one of single searches, of every combination of its lists:

    suite = "posefit-2026.3"
    methods = ["sapso", "cma", { method = "pso", settings = { population_size = 20 } }]
    functions = [1, 5]                          # numbers; by default each
    dimensions = [9, 24]                        # by default 9
    instances = 15                              # the first so many that are held out; or a list
    budgets = [100]                             # evaluations for each dimension
    seeds = 1                                   # 0; or a list

    [grid]
    "sapso.inertia" = [0.7, 0.9]
"""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from importlib.resources import files
from itertools import combinations, product
from math import prod
from pathlib import Path
from typing import Any, Self

from posefit import settings
from posefit.errors import InputError
from posefit.fitting.check import one_of, whole
from posefit.reading import SHOWN, cut, parsed_toml, quoted, read_text
from posefit.registry import registry, version_of
from posefit.suites.functions import DIMENSIONS, FUNCTIONS, HELD_OUT, SUITES, checked_address, suite_function
from posefit.suites.problem import EVALUATIONS, INFEASIBLE
from posefit.sweep.cell import Cell, SearchCell
from posefit.sweep.check import FIELDS, cell_of, families, flattened, label

LISTS = {
    "methods": "method",
    "motions": "motion",
    "views": "view_degrees",
    "corruptions": "corruption",
    "instances": "instance",
    "seeds": "seed",
}
TABLES = ("defaults", "product", "grid", "cells")
SEARCH_FIELDS = (
    "suite", "methods", "functions", "dimensions", "instances", "budgets", "seeds", "infeasible", "grid"
)  # fmt: skip
DEFAULT = "default"  # the name of the plan that posefit brings along
INPUT = "-"  # the name of a plan that is read from standard input
MAX_CELLS = 1_000_000  # cells
MAX_BYTES = 1_000_000  # bytes
GRID = 'settings and their values such as "sapso.inertia" = [0.7, 0.9]'

Entry = Mapping[str, Any]


class Plan:
    """The cells of a sweep, made as they are asked for; no two are equal."""

    def __init__(self, cells: Callable[[], Iterator[Cell]]) -> None:
        self._cells = cells
        keys: set[bytes] = set()
        for cell in cells():
            if (key := bytes.fromhex(cell.key)) in keys:
                raise InputError(f"the cells of a plan must differ, got {cut(str(cell))} twice")
            keys.add(key)
        self._count = len(keys)
        if not keys:
            raise InputError("a plan must hold at least one cell, got none")

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Return the plan of a TOML file, posefit's own for `default`, or that on standard input for `-`.

        Raises ValueError naming the file.
        """
        text = plan_text(path)
        try:
            return cls.of(parsed_toml(text))
        except ValueError as error:
            raise InputError(f"{path}: {error}") from None

    @classmethod
    def of(cls, tables: Mapping[str, Any]) -> Self:
        """Return the plan that a mapping describes, as the TOML file does: of tracks, or of searches of a `suite`.

        Raises ValueError where anything in it is wrong, and ImportError where a method needs a library that is not
        installed.
        """
        return cls(_searches(tables) if "suite" in tables else _tracks(tables))

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Cell]:
        return self._cells()


def plan_text(path: str | Path) -> str:
    """Return the text of a plan: of a file, posefit's own for `default`, or of standard input for `-`."""
    if str(path) == DEFAULT:
        return (files("posefit.sweep") / "default.toml").read_text(encoding="utf-8")
    if str(path) == INPUT:
        try:
            text = sys.stdin.read(MAX_BYTES + 1)
        except UnicodeDecodeError:
            raise InputError(f"{INPUT}: expected a plan in UTF-8, got other bytes") from None
        if len(text) > MAX_BYTES:
            raise InputError(f"{INPUT}: expected a plan of at most {MAX_BYTES:,} characters, got more")
        return text.removeprefix("\ufeff")
    if not Path(path).is_file():
        what = "a folder" if Path(path).is_dir() else "no file of that name"
        raise InputError(f"{path}: expected a plan (.toml) or {DEFAULT}, got {what}")
    return read_text(path, MAX_BYTES, "a plan in TOML")


def _tracks(tables: Mapping[str, Any]) -> Callable[[], Iterator[Cell]]:
    """Return what makes the cells of a plan of tracks."""
    _check_names("a plan", tables, TABLES)
    defaults = _mapping("defaults", tables.get("defaults", {}))
    _check_names("defaults", defaults, FIELDS)
    listed = tables.get("cells", [])
    if not isinstance(listed, list | tuple):
        raise InputError(f"cells must be a list of tables, got {quoted(listed)}")
    shared = flattened("defaults.settings", defaults.get("settings", {}))
    single = [_mapping("cells", spec) for spec in listed]
    lists: list[list[Entry]] = []
    named = _mapping("product", tables.get("product") or {})
    if "grid" in tables and "methods" not in named:
        raise InputError("grid must come with the methods of a product, got none")
    if named:
        _check_names("product", named, LISTS)
        # methods come last, which a product changes soonest: a sweep under way compares them on what is done
        lists = [_entries(name, named[name]) for name in sorted(named, key=lambda name: name == "methods")]
        for entries, other in combinations(lists, 2):
            if twice := {name for entry in entries for name in entry} & {name for entry in other for name in entry}:
                raise InputError(f"product must say {min(twice)} in one list, got it in two")
    if lists and "methods" in named:
        lists[-1] = _gridded(lists[-1], tables.get("grid", {}), families)
    _check_count("product", lists)
    used: set[str] = set()

    def make(spec: Mapping[str, Any]) -> Cell:
        """Return a cell: of the shared settings it has those of what its method uses."""
        method = spec.get("method", defaults.get("method"))
        names = families(method) if shared and isinstance(method, str) else ()
        fitting = {name: value for name, value in shared.items() if name.partition(".")[0] in names}
        used.update(fitting)
        return cell_of({**defaults, **spec, "settings": fitting | flattened("settings", spec.get("settings", {}))})

    def cells() -> Iterator[Cell]:
        for entries in product(*lists) if lists else ():
            yield make({name: value for entry in entries for name, value in entry.items()})
        yield from map(make, single)
        if unused := [name for name in shared if name not in used]:
            raise InputError(
                f"defaults.settings must be of the plan's methods, got {quoted(unused[0])}, which none uses"
            )

    return cells


def _entries(name: str, values: Any) -> list[Entry]:
    """Return the fields that each entry of one list of a product stands for."""
    field = LISTS[name]
    if field in ("instance", "seed") and type(values) is int:
        if values > MAX_CELLS:
            shown = f"{values:,}" if values < 10**SHOWN else quoted(values)
            raise InputError(f"product.{name} must be at most {MAX_CELLS:,}, got {shown}")
        values = range(values)
    if not isinstance(values, list | tuple | range):
        raise InputError(f"product.{name} must be a list, got {quoted(values)}")
    if not values:
        raise InputError(f"product.{name} must hold at least one, got none: an empty product has no cells")
    # a corruption is itself a table
    return [dict(one) if isinstance(one, Mapping) and field != "corruption" else {field: one} for one in values]


def _gridded(methods: Sequence[Entry], grid: Any, names_of: Callable[[str], Sequence[str]]) -> list[Entry]:
    """Return entries of methods, each once for every combination of the grid's settings that it has."""
    lists = flattened("grid", grid) if isinstance(grid, Mapping) else {}
    if (grid and not lists) or not isinstance(grid, Mapping):
        raise InputError(f"grid must hold {GRID}, got {quoted(grid)}")
    for name, values in lists.items():
        if "." not in name or not isinstance(values, list | tuple) or not values:
            raise InputError(f"grid must hold {GRID}, got {name} = {quoted(values)}")
    entries, used = [], set[str]()
    for entry in methods:
        method = entry.get("method")
        names = names_of(method) if lists and isinstance(method, str) else ()
        mine = [name for name in lists if name.partition(".")[0] in names]
        own = flattened("settings", entry.get("settings", {}))
        if twice := [name for name in mine if name in own]:
            raise InputError(f"grid must hold what no entry of methods sets itself, got {twice[0]}, which one does")
        used.update(mine)
        for chosen in product(*(lists[name] for name in mine)):
            entries.append({**entry, "settings": own | dict(zip(mine, chosen, strict=True))} if mine else entry)
    if unused := [name for name in lists if name not in used]:
        known = sorted({name for entry in methods if isinstance(entry.get("method"), str)
                        for name in names_of(entry["method"])})  # fmt: skip
        raise InputError(f"grid must hold settings of {', '.join(known)}, the plan's methods, got {quoted(unused[0])}")
    return entries


def _searches(tables: Mapping[str, Any]) -> Callable[[], Iterator[Cell]]:
    """Return what makes the cells of a plan of searches. A dimension that a function does not have is passed over.

    Raises ValueError where anything is wrong or no cell is left, and ImportError where an optimiser needs a library
    that is not installed.
    """
    _check_names("a plan of a suite", tables, SEARCH_FIELDS)
    suite, infeasible = tables["suite"], tables.get("infeasible", INFEASIBLE[0])
    one_of("suite", suite, SUITES)
    one_of("infeasible", infeasible, INFEASIBLE)
    entries = [_search_entry(entry) for entry in _listed("methods", tables.get("methods"))]
    methods = [
        _method(entry)
        for entry in _gridded(entries, tables.get("grid", {}), lambda method: (method.partition(":")[0],))
    ]
    functions = [
        suite_function(one) for one in _listed("functions", tables.get("functions", [f.number for f in FUNCTIONS]))
    ]
    dimensions = _listed("dimensions", tables.get("dimensions", [9]))
    for dimension in dimensions:
        one_of("dimensions", dimension, DIMENSIONS)
    instances = _numbers("instances", tables.get("instances", 15), HELD_OUT.start)
    budgets = [whole("budgets", one, 1) for one in _listed("budgets", tables.get("budgets", [EVALUATIONS]))]
    seeds = [whole("seeds", one, 0) for one in _numbers("seeds", tables.get("seeds", 1), 0)]
    _check_count("a plan", lists := (dimensions, functions, instances, seeds, budgets, methods))
    if not any(dimension in function.dimensions for function in functions for dimension in dimensions):
        raise InputError(f"a plan must hold at least one cell, got none in {list(dimensions)} dimensions")
    population = lru_cache(maxsize=4096)(lambda k, evaluations: _check_population(*methods[k][:2], evaluations))

    def cells() -> Iterator[Cell]:
        for dimension, function, instance, seed, budget, k in product(*lists[:-1], range(len(methods))):
            if dimension in function.dimensions:
                number, instance, dimension = checked_address(suite, function.number, instance, dimension)
                population(k, budget * dimension)
                method, chosen, name, version = methods[k]
                address = suite, number, dimension, instance, budget * dimension
                yield SearchCell(method, *address, chosen, infeasible, seed, name, version)

    return cells


def _search_entry(value: Any) -> dict[str, Any]:
    table = dict(value) if isinstance(value, Mapping) else {"method": value}
    _check_names("an entry of methods", table, ("method", "name", "settings"))
    if not isinstance(table.get("method"), str) or not isinstance(table.get("settings", {}), Mapping):
        raise InputError(f"an entry of methods must be a name, or a table of a name and settings, got {quoted(value)}")
    return table


def _method(entry: Entry) -> tuple[str, dict[str, Any], str, str]:
    """Return an optimiser's name, its settings, what reports call it, and the versions that its results are of."""
    method = entry["method"]
    chosen = {name.rpartition(".")[2]: value for name, value in entry.get("settings", {}).items()}
    offer = registry().offer("optimiser", method)
    chosen = settings.check(method, offer.factory, chosen)
    return method, chosen, label("name", entry.get("name", "")), version_of([offer.origin])


def _check_population(method: str, chosen: Mapping[str, Any], evaluations: int) -> None:
    if (size := settings.population(registry().optimiser(method), chosen, evaluations)) > evaluations:
        raise InputError(f"evaluations must hold one population of {size}, got {evaluations} of {method}")


def _check_names(what: str, table: Mapping[str, Any], known: Sequence[str] | Mapping[str, str]) -> None:
    for name in table:
        if name not in known:
            raise InputError(f"{what} must hold {', '.join(known)}, got {quoted(name)}")


def _check_count(what: str, lists: Sequence[Sequence[Any]]) -> None:
    if (count := prod(map(len, lists))) > MAX_CELLS:
        raise InputError(f"{what} must hold at most {MAX_CELLS:,} cells, got {count:,}")


def _mapping(name: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError(f"{name} must be a table, got {quoted(value)}")
    return dict(value)


def _listed(name: str, values: Any) -> list[Any]:
    if not isinstance(values, list | tuple) or not values:
        raise InputError(f"{name} must be a list of at least one, got {quoted(values)}")
    return list(values)


def _numbers(name: str, values: Any, first: int) -> list[Any]:
    """Return the numbers of a list, or so many from the first on."""
    if isinstance(values, int) and not isinstance(values, bool):
        if not 1 <= values <= MAX_CELLS:
            raise InputError(f"{name} must be a list, or a whole number from 1 to {MAX_CELLS:,}, got {quoted(values)}")
        return list(range(first, first + values))
    return _listed(name, values)
