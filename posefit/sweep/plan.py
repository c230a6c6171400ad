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
`posefit.sweep.cell.Cell` for what the fields are.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from itertools import chain
from math import prod
from pathlib import Path
from typing import Any, Self

import numpy as np

from posefit.reading import SHOWN, parsed_toml, quoted, read_text
from posefit.sweep.cell import Cell
from posefit.sweep.check import FIELDS, cell_of, flattened, names_of
from posefit.sweep.product import Entries, Product

LISTS = {
    "methods": "method",
    "motions": "motion",
    "views": "view_degrees",
    "corruptions": "corruption",
    "instances": "instance",
    "seeds": "seed",
}
TABLES = ("defaults", "product", "cells")
DEFAULT = "default"  # the name of the plan that posefit brings along
INPUT = "-"  # the name of a plan that is read from standard input
MOST = 1_000_000  # cells
LARGEST_FILE = 1_000_000  # bytes
DIGEST = 32  # bytes of a key


class Plan:
    """The cells of a sweep, made as they are asked for; no two are alike."""

    def __init__(self, *parts: Product | Sequence[Cell]) -> None:
        self._parts = parts
        self._digests = bytearray()
        for digest in chain.from_iterable(_digests(part) for part in parts):
            self._digests += digest
        if not self._digests:
            raise ValueError("a plan must hold at least one cell, got none")
        if twice := _repeated(bytes(self._digests)):
            cell = next(cell for cell in self if cell.key == twice)
            raise ValueError(f"the cells of a plan must differ, got {cell} twice")

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Return the plan of a TOML file, posefit's own for `default`, or that on standard input for `-`.

        Raises ValueError naming the file.
        """
        text = plan_text(path)
        try:
            return cls.of(parsed_toml(text))
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None

    @classmethod
    def of(cls, tables: Mapping[str, Any]) -> Self:
        """Return the plan that a mapping with `defaults`, `product` and `cells` describes, as the TOML file does.

        Raises ValueError where anything in it is wrong, and ImportError where a method needs a library that is not
        installed.
        """
        for name in tables:
            if name not in TABLES:
                raise ValueError(f"a plan must hold {', '.join(TABLES)}, got {quoted(name)}")
        defaults = _mapping("defaults", tables.get("defaults", {}))
        for name in defaults:
            if name not in FIELDS:
                raise ValueError(f"defaults must be of {', '.join(FIELDS)}, got {quoted(name)}")
        listed = tables.get("cells", [])
        if not isinstance(listed, list | tuple):
            raise ValueError(f"cells must be a list of tables, got {quoted(listed)}")
        fitting = _Shared(defaults)

        def make(spec: Mapping[str, Any]) -> Cell:
            return cell_of({**defaults, **spec, "settings": fitting.settings(spec)})

        lists = _lists(tables.get("product"))
        cells = [make(_mapping("cells", one)) for one in listed]
        plan = cls(cells) if lists is None else cls(Product(lists, make), cells)
        fitting.check()
        return plan

    def __len__(self) -> int:
        return len(self._digests) // DIGEST

    def __iter__(self) -> Iterator[Cell]:
        return chain.from_iterable(self._parts)

    def keys(self) -> Iterator[str]:
        """Yield the key of each cell, without making it."""
        return (self._digests[k : k + DIGEST].hex() for k in range(0, len(self._digests), DIGEST))

    @property
    def cells(self) -> tuple[Cell, ...]:
        """All cells, where there are few enough."""
        return tuple(self)


def plan_text(path: str | Path) -> str:
    """Return the text of a plan: of a file, posefit's own for `default`, or what standard input has for `-`."""
    if str(path) == DEFAULT:
        return (files("posefit.sweep") / "default.toml").read_text(encoding="utf-8")
    if str(path) == INPUT:
        return _stdin()
    if not Path(path).is_file():
        raise ValueError(f"{path}: expected a plan (.toml) or {DEFAULT}, got {_what(Path(path))}")
    return read_text(path, LARGEST_FILE, "a plan in TOML")


class _Shared:
    """The settings of the defaults, of which each cell has those that its method uses."""

    def __init__(self, defaults: Mapping[str, Any]) -> None:
        self._method = defaults.get("method")
        self._flat = flattened("defaults.settings", defaults.get("settings", {}))
        self._unused = dict(self._flat)

    def settings(self, spec: Mapping[str, Any]) -> dict[str, Any]:
        """Return the settings of a cell: its own, and of the shared ones those of what its method uses."""
        method = spec.get("method", self._method)
        names = names_of(method) if isinstance(method, str) else ()
        fitting = {name: value for name, value in self._flat.items() if name.partition(".")[0] in names}
        for name in fitting:
            self._unused.pop(name, None)
        return fitting | flattened("settings", spec.get("settings", {}))

    def check(self) -> None:
        """Return nothing. Raises ValueError where no cell used one of them."""
        if self._unused:
            raise ValueError(
                f"defaults.settings must be of the plan's methods, got {next(iter(self._unused))!r}, which none uses"
            )


def _lists(tables: Any) -> list[Entries] | None:
    """Return the entries of each list of a product; None where there is no product.

    Methods come last, which a product changes soonest: a sweep that is under way compares them on what is done.
    """
    if tables is None:
        return None
    named = _mapping("product", tables)
    for name in named:
        if name not in LISTS:
            raise ValueError(f"product must hold {', '.join(LISTS)}, got {quoted(name)}")
    entries = [_entries(name, named[name]) for name in sorted(named, key=lambda name: name == "methods")]
    if (count := prod(len(one) for one in entries)) > MOST:
        raise ValueError(f"product must hold at most {MOST:,} cells, got {count:,}")
    return entries


def _digests(part: Product | Sequence[Cell]) -> Iterator[bytes]:
    return part.digests() if isinstance(part, Product) else (bytes.fromhex(cell.key) for cell in part)


def _repeated(digests: bytes) -> str | None:
    """Return a key that is there twice; None where all differ."""
    starts = np.frombuffer(digests, dtype=np.uint64)[:: DIGEST // 8]  # alike where keys are; seldom where they are not
    values, counts = np.unique(starts, return_counts=True)
    seen: set[bytes] = set()
    for k in np.flatnonzero(np.isin(starts, values[counts > 1])):
        one = digests[DIGEST * k : DIGEST * (k + 1)]
        if one in seen:
            return one.hex()
        seen.add(one)
    return None


def _entries(name: str, values: Any) -> Entries:
    """Return the fields that each entry of one list of a product stands for."""
    field = LISTS[name]
    if field in ("instance", "seed") and type(values) is int:
        if values > MOST:
            raise ValueError(f"product.{name} must be at most {MOST:,}, got {_written(values)}")
        values = range(values)
    if not isinstance(values, list | tuple | range):
        raise ValueError(f"product.{name} must be a list, got {quoted(values)}")
    if not values:
        raise ValueError(f"product.{name} must hold at least one, got none: an empty product has no cells")
    whole = field == "corruption"  # whose value is itself a table
    return Entries(field, values, whole)


def _mapping(name: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise ValueError(f"{name} must be a table, got {quoted(value)}")
    return dict(value)


def _written(number: int) -> str:
    return f"{number:,}" if number < 10**SHOWN else quoted(number)


def _stdin() -> str:
    try:
        return sys.stdin.read(LARGEST_FILE).removeprefix("\ufeff")
    except UnicodeDecodeError:
        raise ValueError(f"{INPUT}: expected a plan in UTF-8, got other bytes") from None


def _what(path: Path) -> str:
    return "a folder" if path.is_dir() else "no file of that name"
