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
from dataclasses import dataclass
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any, Self

from posefit.reading import SHOWN, quoted, read_text, toml_of
from posefit.sweep.cell import Cell
from posefit.sweep.check import FIELDS, cell_of, flattened, names_of

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


@dataclass(frozen=True)
class Plan:
    """The cells of a sweep; no two are alike."""

    cells: tuple[Cell, ...]

    def __post_init__(self) -> None:
        if not self.cells:
            raise ValueError("a plan must hold at least one cell, got none")
        seen: dict[str, Cell] = {}
        for cell in self.cells:
            if cell.key in seen:
                raise ValueError(f"the cells of a plan must differ, got {cell} twice")
            seen[cell.key] = cell

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Return the plan of a TOML file, posefit's own for `default`, or that on standard input for `-`.

        Raises ValueError naming the file.
        """
        if str(path) == DEFAULT:
            text = (files("posefit.sweep") / "default.toml").read_text(encoding="utf-8")
        elif str(path) == INPUT:
            text = _stdin()
        elif not Path(path).is_file():
            raise ValueError(f"{path}: expected a plan (.toml) or {DEFAULT}, got {_what(Path(path))}")
        else:
            text = read_text(path, LARGEST_FILE, "a plan in TOML")
        try:
            return cls.of(toml_of(text))
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
        specs = [*_combined(tables.get("product")), *(_mapping("cells", one) for one in listed)]
        shared = _settings(defaults.get("settings", {}), specs, defaults)
        return cls(
            tuple(cell_of({**defaults, **spec, "settings": mine}) for spec, mine in zip(specs, shared, strict=True))
        )

    def __len__(self) -> int:
        return len(self.cells)

    def __iter__(self) -> Iterator[Cell]:
        return iter(self.cells)


def _combined(tables: Any) -> list[dict[str, Any]]:
    """Return the specs of a product."""
    if tables is None:
        return []
    lists = _mapping("product", tables)
    for name in lists:
        if name not in LISTS:
            raise ValueError(f"product must hold {', '.join(LISTS)}, got {quoted(name)}")
    entries = [_entries(name, values) for name, values in lists.items()]
    count = 1
    for one in entries:
        count *= len(one)
    if count > MOST:
        raise ValueError(f"product must hold at most {MOST:,} cells, got {count:,}")
    specs = []
    for chosen in product(*entries):
        spec: dict[str, Any] = {}
        for fields in chosen:
            if twice := sorted(spec.keys() & fields.keys()):
                raise ValueError(f"product must say {twice[0]} in one list, got it in two")
            spec |= fields
        specs.append(spec)
    return specs


def _entries(name: str, values: Any) -> list[dict[str, Any]]:
    """Return the fields that each entry of one list of a product stands for."""
    field = LISTS[name]
    if field in ("instance", "seed") and type(values) is int:
        if values > MOST:
            raise ValueError(f"product.{name} must be at most {MOST:,}, got {_written(values)}")
        values = list(range(values))
    if not isinstance(values, list | tuple):
        raise ValueError(f"product.{name} must be a list, got {quoted(values)}")
    if not values:
        raise ValueError(f"product.{name} must hold at least one, got none: an empty product has no cells")
    whole = field == "corruption"  # whose value is itself a table
    return [dict(one) if isinstance(one, Mapping) and not whole else {field: one} for one in values]


def _settings(shared: Any, specs: Sequence[Mapping[str, Any]], defaults: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the settings of every cell: its own, and of the shared ones those of what its method uses."""
    flat = flattened("defaults.settings", shared)
    unused = dict(flat)
    mine = []
    for spec in specs:
        method = spec.get("method", defaults.get("method"))
        names = names_of(method) if isinstance(method, str) else ()
        fitting = {name: value for name, value in flat.items() if name.partition(".")[0] in names}
        for name in fitting:
            unused.pop(name, None)
        mine.append(fitting | flattened("settings", spec.get("settings", {})))
    if specs and unused:
        raise ValueError(
            f"defaults.settings must be of the plan's methods, got {next(iter(unused))!r}, which none uses"
        )
    return mine


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
