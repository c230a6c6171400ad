"""The cells of a product, one after the other: a million are never in memory together, and none is checked twice.

Fields that are checked with each other are checked once for each of their combinations; every other value once. A
cell's key is the SHA-256 of its fields as JSON, and so of pieces that many cells have in common.
"""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from itertools import combinations, product
from math import prod
from typing import Any, overload

from posefit.errors import InputError
from posefit.sweep.cell import TrackCell, json_of
from posefit.sweep.check import FIELDS, checked

NAMES = tuple(sorted(one.name for one in fields(TrackCell)))  # in the order of a key
CROSSED = ("method", "motion", "train", "settings", "frames", "fps", "evaluations")  # checked together by `cell_of`
CACHED = 4096  # combinations of these that are kept in memory

Entry = Mapping[str, Any]


class Entries(Sequence[Entry]):
    """The fields that each value of a list stands for: those of a table, or `field`, which a `whole` one is."""

    def __init__(self, field: str, values: Sequence[Any], whole: bool = False) -> None:
        self._field, self._values, self._whole = field, values, whole

    def __len__(self) -> int:
        return len(self._values)

    @overload
    def __getitem__(self, k: int) -> Entry: ...
    @overload
    def __getitem__(self, k: slice) -> Sequence[Entry]: ...
    def __getitem__(self, k: int | slice) -> Entry | Sequence[Entry]:
        """Return the fields of the kth value."""
        if isinstance(k, slice):
            return Entries(self._field, self._values[k], self._whole)
        value = self._values[k]
        return dict(value) if isinstance(value, Mapping) and not self._whole else {self._field: value}


class _Separate:
    """The entries of a list whose fields are checked by themselves: once each, or as they come where there are many."""

    def __init__(self, entries: Sequence[Entry]) -> None:
        self._entries = entries
        self._known = [self._made(k) for k in range(len(entries))] if len(entries) <= CACHED else []

    def __getitem__(self, k: int) -> tuple[Entry, list[tuple[int, str]]]:
        """Return the checked fields of an entry; and, as JSON, with their places among all fields."""
        return self._known[k] if self._known else self._made(k)

    def _made(self, k: int) -> tuple[Entry, list[tuple[int, str]]]:
        fields = checked(self._entries[k])
        return fields, [(NAMES.index(name), _piece(name, value)) for name, value in fields.items()]


class Product:
    """Cells that some lists of entries stand for, in the order of `itertools.product`.

    `make` gives the cell of a spec, checked. Raises ValueError where a field stands in two lists.
    """

    def __init__(self, lists: Sequence[Sequence[Entry]], make: Callable[[Entry], TrackCell]) -> None:
        for one, other in combinations(lists, 2):
            if twice := {name for entry in one for name in entry} & {name for entry in other for name in entry}:
                raise InputError(f"product must say {min(twice)} in one list, got it in two")
        self._lists, self._make = lists, make
        separate = set(FIELDS) - set(CROSSED)
        self._separate = {
            n: _Separate(entries)
            for n, entries in enumerate(lists)
            if all(separate.issuperset(entry) for entry in entries)
        }
        self._known: dict[tuple[int, ...], tuple[TrackCell, list[str]]] = {}

    def __len__(self) -> int:
        return prod(len(entries) for entries in self._lists)

    def __iter__(self) -> Iterator[TrackCell]:
        for chosen, cell, key in self._combined():
            fields = {name: getattr(cell, name) for name in NAMES}
            for n, entries in self._separate.items():
                fields |= entries[chosen[n]][0]
            whole = TrackCell(**fields)
            vars(whole)["key"] = key.hex()  # its cached property
            yield whole

    def digests(self) -> Iterator[bytes]:
        """Yield the key of each cell, as 32 bytes."""
        return (key for _, _, key in self._combined())

    def _combined(self) -> Iterator[tuple[tuple[int, ...], TrackCell, bytes]]:
        """Yield for each cell which entries it is of, a cell with the same crossed fields, and its key."""
        for chosen in product(*(range(len(entries)) for entries in self._lists)):
            cell, common = self._common(chosen)
            pieces = common.copy()
            for n, entries in self._separate.items():
                for place, piece in entries[chosen[n]][1]:
                    pieces[place] = piece
            yield chosen, cell, hashlib.sha256(f"{{{','.join(pieces)}}}".encode()).digest()

    def _common(self, chosen: tuple[int, ...]) -> tuple[TrackCell, list[str]]:
        """Return a cell with the crossed fields of some entries, and its fields as JSON."""
        crossed = tuple([-1 if n in self._separate else k for n, k in enumerate(chosen)])
        known = self._known.get(crossed)
        if known is None:
            spec: dict[str, Any] = {}
            for entries, k in zip(self._lists, chosen, strict=True):
                spec |= entries[k]
            cell = self._make(spec)
            known = cell, [_piece(name, getattr(cell, name)) for name in NAMES]
            if len(self._known) >= CACHED:
                self._known.clear()
            self._known[crossed] = known
        return known


def _piece(name: str, value: Any) -> str:
    """Return a field as JSON holds it in a key."""
    return f'"{name}":{json_of(value)}'
