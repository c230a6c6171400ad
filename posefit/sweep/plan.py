"""A plan: the cells of a sweep, all checked before anything runs.

docs/howto/plan.md describes a plan's tables: the `defaults` of every cell, a `product`
of lists, a `grid` of settings, and single `cells`. An entry of a list is the value of a
cell's field, or a table of several fields. `posefit.sweep.cell` describes the fields.

A plan that names a `suite` consists of single searches. It has the lists of a product,
but no table around them.
"""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.resources import files
from itertools import chain, product
from math import prod
from pathlib import Path
from typing import Any, Self

from posefit.errors import InputError
from posefit.motion.instances import HELD_OUT
from posefit.reading import SHOWN, cut, parsed_toml, quoted, read_text
from posefit.suites.functions import FUNCTIONS, suite_function
from posefit.suites.problem import EVALUATIONS
from posefit.sweep.cell import Cell
from posefit.sweep.check import (
    FIELDS,
    cell_of,
    check_names,
    clear_caches,
    families,
    flattened,
    search_method,
    search_of,
)

# the lists of a product of tracks, with the field that each sets
LISTS = {
    "methods": "method",
    "motions": "motion",
    "views": "view_degrees",
    "corruptions": "corruption",
    "instances": "instance",
    "seeds": "seed",
}
# the lists of a plan of searches, with the field of each and its default
SEARCH_LISTS = {
    "dimensions": ("dimension", [9]),
    "functions": ("function", [function.number for function in FUNCTIONS]),
    "instances": ("instance", 15),
    "seeds": ("seed", 1),
    "budgets": ("budget", [EVALUATIONS]),
    "methods": ("method", []),
}
PARTS = {"optimisers": "optimiser", "priors": "prior"}  # the parts of a method
TABLES = ("defaults", "product", "grid", "cells")
DEFAULT = "default"  # the name of the plan that comes with posefit
INPUT = "-"  # the name of a plan that is read from standard input
MAX_CELLS = 1_000_000  # most cells of a product
MAX_BYTES = 1_000_000  # most bytes of a plan's text
# what a grid contains, for messages
GRID = 'settings and their values such as "sapso.inertia" = [0.7, 0.9]'

Entry = Mapping[str, Any]


class Plan:
    """The cells of a sweep, all different. Each iteration makes them again.

    Args:
        cells: Returns an iterator of the cells.

    Raises:
        InputError: There is no cell, or two cells are equal.
    """

    def __init__(self, cells: Callable[[], Iterator[Cell]]) -> None:
        self._cells = cells
        clear_caches()
        keys: set[bytes] = set()
        for cell in cells():
            if (key := bytes.fromhex(cell.key)) in keys:
                raise InputError(
                    f"the cells of a plan must differ, got {cut(str(cell))} twice"
                )
            keys.add(key)
        self._count = len(keys)
        if not keys:
            raise InputError("a plan must contain at least one cell, got none")

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Return the plan of a TOML file.

        Args:
            path: The file, `default` for posefit's own plan, or `-` for standard input.

        Returns:
            The checked plan.

        Raises:
            ValueError: The file cannot be read, or the plan is wrong. The message names
                the file.
        """
        text = plan_text(path)
        try:
            return cls.of(parsed_toml(text))
        except ValueError as error:
            raise InputError(f"{path}: {error}") from None

    @classmethod
    def of(cls, tables: Mapping[str, Any]) -> Self:
        """Return the plan that a mapping describes.

        Args:
            tables: The tables of the TOML file by name.

        Returns:
            The checked plan: of searches if it names a `suite`, else of tracks.

        Raises:
            ValueError: Anything in the plan is wrong.
            ImportError: A method needs a library that is not installed.
        """
        if "suite" in tables:
            return cls(_searches(tables))
        return cls(_tracks(tables))

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Cell]:
        return self._cells()


def plan_text(path: str | Path) -> str:
    """Return the text of a plan.

    `path` is a file, `default` for posefit's own plan, or `-` for standard input.
    Raises InputError if the text cannot be read or is too long.
    """
    if str(path) == DEFAULT:
        return (files("posefit.sweep") / "default.toml").read_text(encoding="utf-8")
    if str(path) == INPUT:
        try:
            text = sys.stdin.read(MAX_BYTES + 1)
        except UnicodeDecodeError:
            raise InputError(
                f"{INPUT}: expected a plan in UTF-8, got other bytes"
            ) from None
        if len(text) > MAX_BYTES:
            raise InputError(
                f"{INPUT}: expected a plan of at most {MAX_BYTES:,} characters, "
                "got more"
            )
        return text.removeprefix("\ufeff")  # the byte-order mark
    if not Path(path).is_file():
        what = "a folder" if Path(path).is_dir() else "no file of that name"
        raise InputError(f"{path}: expected a plan (.toml) or {DEFAULT}, got {what}")
    return read_text(path, MAX_BYTES, "a plan in TOML")


def _tracks(tables: Mapping[str, Any]) -> Callable[[], Iterator[Cell]]:
    """Return a function that makes the cells of a plan of tracks."""
    check_names("a plan", tables, TABLES)
    defaults = _mapping("defaults", tables.get("defaults", {}))
    check_names("defaults", defaults, FIELDS)
    shared = flattened("defaults.settings", defaults.get("settings", {}))
    listed = tables.get("cells", [])
    if not isinstance(listed, list | tuple):
        raise InputError(f"cells must be a list of tables, got {quoted(listed)}")
    single = [_mapping("cells", spec) for spec in listed]
    lists = _track_lists(tables)

    def cells() -> Iterator[Cell]:
        used: set[str] = set()
        for spec in chain(_product(lists), single):
            method = spec.get("method", defaults.get("method"))
            # a method gets the shared settings that it has
            settings = {}
            if shared and isinstance(method, str):
                settings = _of_families(shared, families(method))
            used.update(settings)
            settings |= flattened("settings", spec.get("settings", {}))
            yield cell_of({**defaults, **spec, "settings": settings})
        for name in shared:
            if name not in used:
                raise InputError(
                    "defaults.settings must be settings of the plan's methods, "
                    f"got {quoted(name)}, which none of them uses"
                )

    return cells


def _track_lists(tables: Mapping[str, Any]) -> dict[str, Sequence[Any]]:
    """Return the entries of a product's lists by their fields, methods last.

    A product varies its last list fastest. So an unfinished sweep has all methods on
    the cases that are done.
    """
    crossed = _mapping("product", tables.get("product") or {})
    check_names("product", crossed, [*LISTS, *PARTS])
    if any(part in crossed for part in PARTS):
        crossed = _with_methods(crossed)
    lists: dict[str, Sequence[Any]] = {}
    for name, values in crossed.items():
        lists[LISTS[name]] = _listed(f"product.{name}", LISTS[name], values)
    _check_fields(lists)
    if "methods" in crossed:
        methods = lists.pop("method")
        lists["method"] = _gridded(methods, tables.get("grid", {}), families)
    elif "grid" in tables:
        raise InputError("grid must come with the methods of a product, got none")
    _check_count(lists)
    return lists


def _of_families(settings: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Return the settings, NAME.SETTING, whose NAME is one of the names."""
    chosen = {}
    for setting, value in settings.items():
        if setting.partition(".")[0] in names:
            chosen[setting] = value
    return chosen


def _with_methods(crossed: Mapping[str, Any]) -> dict[str, Any]:
    """Return the lists of a product, with `methods` instead of optimisers and priors.

    The methods pair each optimiser with each prior.
    """
    if "methods" in crossed or not all(part in crossed for part in PARTS):
        raise InputError(
            "product must contain methods, or both optimisers and priors, "
            f"got {', '.join(crossed)}"
        )
    parts = []
    for plural, singular in PARTS.items():
        entries = _listed(f"product.{plural}", singular, crossed[plural])
        tables = [_fields(singular, entry) for entry in entries]
        for table in tables:
            check_names(f"an entry of {plural}", table, (singular, "settings"))
            if not isinstance(table.get(singular), str):
                raise InputError(
                    f"an entry of {plural} must be a name, or a table with {singular}, "
                    f"got {quoted(dict(table))}"
                )
        parts.append(tables)
    methods = []
    for optimiser, prior in product(*parts):
        settings: dict[str, Any] = {}
        for kind, table in (("optimiser", optimiser), ("prior", prior)):
            name = table[kind].partition(":")[0]
            # in the entry of a part, its name may be left out of its settings' names
            for key, value in flattened("settings", table.get("settings", {})).items():
                settings[key if "." in key else f"{name}.{key}"] = value
        method = f"{optimiser['optimiser']}@{prior['prior']}"
        methods.append({"method": method, "settings": settings})
    lists = dict(crossed)
    for part in PARTS:
        del lists[part]
    return {**lists, "methods": methods}


def _searches(tables: Mapping[str, Any]) -> Callable[[], Iterator[Cell]]:
    """Return a function that makes the cells of a plan of searches.

    A function has no cells in dimensions in which it does not exist. Raises InputError
    if a function that the plan names exists in none of its dimensions.
    """
    check_names(
        "a plan of a suite", tables, ("suite", *SEARCH_LISTS, "infeasible", "grid")
    )
    shared = {name: tables[name] for name in ("suite", "infeasible") if name in tables}
    lists = {}
    for name, (field, default) in SEARCH_LISTS.items():
        # settings may have been chosen on the instances before these
        first = HELD_OUT.start if name == "instances" else 0
        lists[field] = _listed(name, field, tables.get(name, default), first)
    methods = _gridded(
        lists["method"],
        tables.get("grid", {}),
        lambda method: (method.partition(":")[0],),
    )
    lists["method"] = list(map(search_method, methods))
    _check_fields(lists)
    _check_count(lists)

    def cells() -> Iterator[Cell]:
        searched = set()  # the functions that have cells
        for spec in _product(lists):
            cell = search_of({**shared, **spec})
            if cell is not None:
                searched.add(cell.function)
                yield cell
        for entry in tables.get("functions", ()):
            number = suite_function(_fields("function", entry)["function"]).number
            if number not in searched:
                raise InputError(
                    "functions must exist in one of the plan's dimensions, "
                    f"got {number}, which exists in none of them"
                )

    return cells


def _product(lists: Mapping[str, Sequence[Any]]) -> Iterator[Entry]:
    """Yield the fields of every combination of the lists' entries.

    Without lists there are no combinations.
    """
    # the product of no lists would be one empty combination
    if not lists:
        return
    for entries in product(*lists.values()):
        spec: dict[str, Any] = {}
        for field, entry in zip(lists, entries, strict=True):
            spec.update(_fields(field, entry))
        yield spec


def _fields(field: str, entry: Any) -> Entry:
    """Return the fields that an entry of a field's list sets."""
    # the value of a corruption is itself a table
    if isinstance(entry, Mapping) and field != "corruption":
        return entry
    return {field: entry}


def _listed(name: str, field: str, values: Any, first: int = 0) -> Sequence[Any]:
    """Return the entries of a list.

    For instances and seeds a number N means the N numbers from `first` on.
    """
    if field in ("instance", "seed") and type(values) is int:
        if values > MAX_CELLS:
            shown = f"{values:,}" if values < 10**SHOWN else quoted(values)
            raise InputError(f"{name} must be at most {MAX_CELLS:,}, got {shown}")
        values = range(first, first + values)
    if not isinstance(values, list | tuple | range):
        raise InputError(f"{name} must be a list, got {quoted(values)}")
    if not values:
        raise InputError(
            f"{name} must contain at least one, got none: an empty product has no cells"
        )
    return values


def _gridded(
    methods: Sequence[Any], grid: Any, names_of: Callable[[str], Sequence[str]]
) -> list[Entry]:
    """Return each method with every combination of the grid's settings that it has.

    Args:
        methods: Entries of a list of methods.
        grid: The values of each setting by its name NAME.SETTING.
        names_of: Returns the NAMEs of a method.

    Returns:
        The entries, each with its settings.
    """
    lists = _grid_lists(grid)
    entries = []
    used = set[str]()
    known = set[str]()
    for entry in (_fields("method", entry) for entry in methods):
        method = entry.get("method")
        names: Sequence[str] = ()
        if lists and isinstance(method, str):
            names = names_of(method)
        own_lists = _of_families(lists, names)
        entries += _with_settings(entry, own_lists)
        known.update(names)
        used.update(own_lists)
    for name in lists:
        if name not in used:
            raise InputError(
                f"grid must contain settings of {', '.join(sorted(known))}, the plan's "
                f"methods, got {quoted(name)}"
            )
    return entries


def _with_settings(entry: Entry, lists: Mapping[str, Any]) -> list[Entry]:
    """Return a method's entry with every combination of the values of some settings.

    Raises InputError if the entry itself sets one of them.
    """
    if not lists:
        return [entry]
    own = flattened("settings", entry.get("settings", {}))
    for name in lists:
        # an entry may name its settings with or without the method's name
        if {name, name.rpartition(".")[2]} & own.keys():
            raise InputError(
                "grid must contain settings that no entry of methods sets itself, "
                f"got {name}, which one sets"
            )
    entries: list[Entry] = []
    for values in product(*lists.values()):
        settings = own | dict(zip(lists, values, strict=True))
        entries.append({**entry, "settings": settings})
    return entries


def _grid_lists(grid: Any) -> dict[str, Any]:
    """Return the values of each setting of a grid by its name NAME.SETTING."""
    lists = flattened("grid", grid) if isinstance(grid, Mapping) else {}
    if not isinstance(grid, Mapping) or (grid and not lists):
        raise InputError(f"grid must contain {GRID}, got {quoted(grid)}")
    for name, values in lists.items():
        if "." not in name or not isinstance(values, list | tuple) or not values:
            raise InputError(f"grid must contain {GRID}, got {name} = {quoted(values)}")
    return lists


def _check_fields(lists: Mapping[str, Sequence[Any]]) -> None:
    """Raise InputError if two lists set the same field."""
    earlier = set[str]()  # the fields that the lists before this one set
    for field, entries in lists.items():
        names = set[str]().union(*(_fields(field, entry) for entry in entries))
        if names & earlier:
            raise InputError(
                f"a product must set {min(names & earlier)} in one list, got it in two"
            )
        earlier |= names


def _check_count(lists: Mapping[str, Sequence[Any]]) -> None:
    if (count := prod(map(len, lists.values()))) > MAX_CELLS:
        raise InputError(
            f"a product must have at most {MAX_CELLS:,} cells, got {count:,}"
        )


def _mapping(name: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError(f"{name} must be a table, got {quoted(value)}")
    return dict(value)
