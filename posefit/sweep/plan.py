"""A plan: which cells a sweep consists of, all checked before anything runs.

    [defaults]                                  # what holds for every cell that says nothing else
    frames = 30
    settings = { sapso.cooling = 0.9 }          # of the methods that use them

    [product]                                   # every combination of
    methods = ["sapso@pca", "cma@full", { method = "sapso@loose", settings = { sapso.cooling = 0.8 } }]
    motions = ["walk", "walk-a", { motion = "16_17.amc", train = ["16_15.amc"] }]
    views = [45, [0, 90]]                       # degrees; several for several cameras
    corruptions = [{}, { holes = 0.3, dropped = 0.1 }]
    instances = 3                               # 0, 1, 2; or a list
    seeds = [0, 1, 2, 3, 4]

    [[cells]]                                   # and these
    method = "random@pca"
    motion = "run"

An entry of a list of the product is the value of a cell's field, or a table of several fields. See
`posefit.sweep.cell.TrackCell` for what the fields are.

A plan that names a suite is one of single searches, of every combination of its lists:

    suite = "posefit-2026.3"
    methods = ["sapso", "cma", { method = "pso", settings = { population_size = 20 } }]
    functions = [1, 5]                          # numbers; by default each
    dimensions = [9, 24]                        # by default 9
    instances = 15                              # the first so many that are held out; or a list
    budgets = [100]                             # evaluations for each dimension
    seeds = 1                                   # 0; or a list
"""

import hashlib
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import cache, lru_cache
from importlib.resources import files
from itertools import chain, combinations, product
from math import prod
from pathlib import Path
from typing import Any, Self

import numpy as np

from posefit import settings
from posefit.errors import InputError
from posefit.fitting.check import one_of, whole
from posefit.reading import SHOWN, cut, parsed_toml, quoted, read_text
from posefit.registry import registry, version_of
from posefit.suites.functions import DIMENSIONS, FUNCTIONS, HELD_OUT, SUITES, checked_address, suite_function
from posefit.suites.problem import EVALUATIONS, INFEASIBLE
from posefit.sweep.cell import Cell, SearchCell, TrackCell, json_of
from posefit.sweep.check import FIELDS, cell_of, checked, families, flattened

LISTS = {
    "methods": "method",
    "motions": "motion",
    "views": "view_degrees",
    "corruptions": "corruption",
    "instances": "instance",
    "seeds": "seed",
}
TABLES = ("defaults", "product", "cells")
SEARCH_FIELDS = ("suite", "methods", "functions", "dimensions", "instances", "budgets", "seeds", "infeasible")
DEFAULT = "default"  # the name of the plan that posefit brings along
INPUT = "-"  # the name of a plan that is read from standard input
MAX_CELLS = 1_000_000  # cells
MAX_BYTES = 1_000_000  # bytes
DIGEST_BYTES = 32  # of a key
NAMES = tuple(sorted(field.name for field in fields(TrackCell)))  # in the order of a key
CROSSED = ("method", "motion", "train", "settings", "frames", "fps", "evaluations")  # checked together by `cell_of`
CACHED = 4096  # combinations of these, and entries of a list, that are kept in memory

Entry = Mapping[str, Any]


class Entries:
    """The fields that each value of a list stands for: those of a table, or `field`, which a `whole` one is."""

    def __init__(self, field: str, values: Sequence[Any], whole: bool = False) -> None:
        self._field, self._values, self._whole = field, values, whole
        # the checked fields of an entry; and, as JSON, with their places among all fields
        self.checked = cache(self._checked) if len(values) <= CACHED else self._checked

    def __len__(self) -> int:
        return len(self._values)

    def __iter__(self) -> Iterator[Entry]:
        return (self[k] for k in range(len(self)))

    def __getitem__(self, k: int) -> Entry:
        """Return the fields of the kth value."""
        value = self._values[k]
        return dict(value) if isinstance(value, Mapping) and not self._whole else {self._field: value}

    def _checked(self, k: int) -> tuple[Entry, list[tuple[int, str]]]:
        fields = checked(self[k])
        return fields, [(NAMES.index(name), _piece(name, value)) for name, value in fields.items()]


class Product:
    """Cells that some lists of entries stand for, one after the other, in the order of `itertools.product`.

    A million cells are never in memory together, and none is checked twice: fields that are checked with each other are
    checked once for each of their combinations; every other value once. A cell's key is the SHA-256 of its fields as
    JSON, and so of pieces that many cells have in common. `make` gives the cell of a spec, checked. Raises ValueError
    where a field stands in two lists.
    """

    def __init__(self, lists: Sequence[Entries], make: Callable[[Entry], TrackCell]) -> None:
        for entries, other in combinations(lists, 2):
            if twice := {name for entry in entries for name in entry} & {name for entry in other for name in entry}:
                raise InputError(f"product must say {min(twice)} in one list, got it in two")
        self._lists, self._make = lists, make
        separate = set(FIELDS) - set(CROSSED)
        self._separate = {
            n: entries for n, entries in enumerate(lists) if all(separate.issuperset(entry) for entry in entries)
        }
        self._common = lru_cache(CACHED)(self._made)

    def __iter__(self) -> Iterator[TrackCell]:
        for chosen, cell, key in self._combined():
            fields = {name: getattr(cell, name) for name in NAMES}
            for n, entries in self._separate.items():
                fields |= entries.checked(chosen[n])[0]
            whole = TrackCell(**fields)
            vars(whole)["key"] = key.hex()  # its cached property
            yield whole

    def digests(self) -> Iterator[bytes]:
        """Yield the key of each cell, as 32 bytes."""
        return (key for _, _, key in self._combined())

    def _combined(self) -> Iterator[tuple[tuple[int, ...], TrackCell, bytes]]:
        """Yield for each cell which entries it is of, a cell with the same crossed fields, and its key."""
        for chosen in product(*(range(len(entries)) for entries in self._lists)):
            cell, common = self._common(tuple([0 if n in self._separate else k for n, k in enumerate(chosen)]))
            pieces = common.copy()
            for n, entries in self._separate.items():
                for place, piece in entries.checked(chosen[n])[1]:
                    pieces[place] = piece
            yield chosen, cell, hashlib.sha256(f"{{{','.join(pieces)}}}".encode()).digest()

    def _made(self, crossed: tuple[int, ...]) -> tuple[TrackCell, list[str]]:
        """Return a cell of some entries, of those with separate fields the first, and its fields as JSON."""
        spec: dict[str, Any] = {}
        for entries, k in zip(self._lists, crossed, strict=True):
            spec |= entries[k]
        cell = self._make(spec)
        return cell, [_piece(name, getattr(cell, name)) for name in NAMES]


def _piece(name: str, value: Any) -> str:
    return f'"{name}":{json_of(value)}'


class Plan:
    """The cells of a sweep, made as they are asked for; no two are equal."""

    def __init__(self, *parts: Product | Sequence[Cell]) -> None:
        self._parts = parts
        self._digests = bytearray()
        for digest in chain.from_iterable(_digests(part) for part in parts):
            self._digests += digest
        if not self._digests:
            raise InputError("a plan must hold at least one cell, got none")
        if twice := _repeated(bytes(self._digests)):
            cell = next(cell for cell in self if cell.key == twice)
            raise InputError(f"the cells of a plan must differ, got {cut(str(cell))} twice")

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
        if "suite" in tables:
            return cls(search_cells(tables))
        for name in tables:
            if name not in TABLES:
                raise InputError(f"a plan must hold {', '.join(TABLES)}, got {quoted(name)}")
        defaults = _mapping("defaults", tables.get("defaults", {}))
        for name in defaults:
            if name not in FIELDS:
                raise InputError(f"defaults must be of {', '.join(FIELDS)}, got {quoted(name)}")
        listed = tables.get("cells", [])
        if not isinstance(listed, list | tuple):
            raise InputError(f"cells must be a list of tables, got {quoted(listed)}")
        shared = flattened("defaults.settings", defaults.get("settings", {}))
        used: set[str] = set()

        def make(spec: Mapping[str, Any]) -> TrackCell:
            """Return a cell: of the shared settings it has those of what its method uses."""
            method = spec.get("method", defaults.get("method"))
            names = families(method) if isinstance(method, str) else ()
            fitting = {name: value for name, value in shared.items() if name.partition(".")[0] in names}
            used.update(fitting)
            return cell_of({**defaults, **spec, "settings": fitting | flattened("settings", spec.get("settings", {}))})

        lists = _lists(tables.get("product"))
        cells = [make(_mapping("cells", spec)) for spec in listed]
        plan = cls(cells) if lists is None else cls(Product(lists, make), cells)
        if unused := [name for name in shared if name not in used]:
            raise InputError(
                f"defaults.settings must be of the plan's methods, got {quoted(unused[0])}, which none uses"
            )
        return plan

    def __len__(self) -> int:
        return len(self._digests) // DIGEST_BYTES

    def __iter__(self) -> Iterator[Cell]:
        return chain.from_iterable(self._parts)

    def keys(self) -> Iterator[str]:
        """Yield the key of each cell, without making it."""
        return (self._digests[k : k + DIGEST_BYTES].hex() for k in range(0, len(self._digests), DIGEST_BYTES))


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


def _lists(tables: Any) -> list[Entries] | None:
    """Return the entries of each list of a product; None where there is no product.

    Methods come last, which a product changes soonest: a sweep that is under way compares them on what is done.
    """
    if tables is None:
        return None
    named = _mapping("product", tables)
    for name in named:
        if name not in LISTS:
            raise InputError(f"product must hold {', '.join(LISTS)}, got {quoted(name)}")
    entries = [_entries(name, named[name]) for name in sorted(named, key=lambda name: name == "methods")]
    if (count := prod(len(one) for one in entries)) > MAX_CELLS:
        raise InputError(f"product must hold at most {MAX_CELLS:,} cells, got {count:,}")
    return entries


def _digests(part: Product | Sequence[Cell]) -> Iterator[bytes]:
    return part.digests() if isinstance(part, Product) else (bytes.fromhex(cell.key) for cell in part)


def _repeated(digests: bytes) -> str | None:
    """Return a key that occurs twice; None where all differ."""
    values, counts = np.unique(np.frombuffer(digests, dtype=f"S{DIGEST_BYTES}"), return_counts=True)
    repeated = values[counts > 1]
    return bytes(repeated[0]).ljust(DIGEST_BYTES, b"\0").hex() if len(repeated) else None


def _entries(name: str, values: Any) -> Entries:
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
    whole = field == "corruption"  # whose value is itself a table
    return Entries(field, values, whole)


def _mapping(name: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError(f"{name} must be a table, got {quoted(value)}")
    return dict(value)


def search_cells(tables: Mapping[str, Any]) -> list[SearchCell]:
    """Return the cells of a plan of single searches. A dimension that a function does not have is passed over.

    Raises ValueError where anything is wrong or no cell is left, and ImportError where an optimiser needs a library
    that is not installed.
    """
    for name in tables:
        if name not in SEARCH_FIELDS:
            raise InputError(f"a plan of a suite must hold {', '.join(SEARCH_FIELDS)}, got {quoted(name)}")
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
    if (count := prod(map(len, lists))) > MAX_CELLS:
        raise InputError(f"a plan must hold at most {MAX_CELLS:,} cells, got {count:,}")
    cells = []
    for dimension, function, instance, seed, budget, (method, chosen, version) in product(*lists):
        if dimension in function.dimensions:
            number, instance, dimension = checked_address(suite, function.number, instance, dimension)
            evaluations = budget * dimension
            if (size := settings.population(registry().optimiser(method), chosen, evaluations)) > evaluations:
                raise InputError(f"evaluations must hold one population of {size}, got {evaluations} of {method}")
            cells.append(
                SearchCell(method, suite, number, dimension, instance, evaluations, chosen, infeasible, seed, version)
            )
    if not cells:
        raise InputError(f"a plan must hold at least one cell, got none in {list(dimensions)} dimensions")
    return cells


def _method(value: Any) -> tuple[str, dict[str, Any], str]:
    """Return an optimiser's name, its settings, and the versions that its results are of."""
    table = dict(value) if isinstance(value, Mapping) else {"method": value}
    for name in table:
        if name not in ("method", "settings"):
            raise InputError(f"an entry of methods must hold method and settings, got {quoted(name)}")
    method, chosen = table.get("method"), table.get("settings", {})
    if not isinstance(method, str) or not isinstance(chosen, Mapping):
        raise InputError(f"an entry of methods must be a name, or a table of a name and settings, got {quoted(value)}")
    offer = registry().offer("optimiser", method)
    settings.check(method, offer.factory, chosen)
    return method, dict(chosen), version_of([offer.origin])


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
