"""The cells of a product, one after the other: a million are never in memory together, and none is checked twice.

Fields that are checked with each other are checked once for each of their combinations; every other value once. A
cell's key is the SHA-256 of its fields as JSON, and so of pieces that many cells have in common.
"""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations, product
from math import prod
from typing import Any

from posefit.sweep.cell import NAMES, Cell, json_of
from posefit.sweep.check import FIELDS, checked

CROSSED = ("method", "motion", "train", "settings", "frames", "fps", "evaluations")  # which `cell_of` checks together
KEPT = 4096  # combinations of these that are kept, to be met again

Entry = Mapping[str, Any]


class Product:
    """Cells that some lists of entries stand for, in the order of `itertools.product`.

    `make` gives the cell of a spec, checked. Raises ValueError where a field stands in two lists.
    """

    def __init__(self, lists: Sequence[Sequence[Entry]], make: Callable[[Entry], Cell]) -> None:
        for one, other in combinations(lists, 2):
            if twice := {name for entry in one for name in entry} & {name for entry in other for name in entry}:
                raise ValueError(f"product must say {min(twice)} in one list, got it in two")
        self._lists, self._make = lists, make
        loose = set(FIELDS) - set(CROSSED)
        self._loose = [all(loose.issuperset(entry) for entry in entries) for entries in lists]
        self._checked = [
            [checked(entry) if is_loose else {} for entry in entries]
            for entries, is_loose in zip(lists, self._loose, strict=True)
        ]
        self._pieces = [
            [[(NAMES.index(name), _piece(name, value)) for name, value in fields.items()] for fields in entries]
            for entries in self._checked
        ]
        self._known: dict[tuple[int, ...], tuple[Cell, list[str]]] = {}

    def __len__(self) -> int:
        return prod(len(entries) for entries in self._lists)

    def __iter__(self) -> Iterator[Cell]:
        for chosen, cell, key in self._combined():
            fields = {name: getattr(cell, name) for name in NAMES}
            for entries, k in zip(self._checked, chosen, strict=True):
                fields |= entries[k]
            found = Cell(**fields)
            vars(found)["key"] = key.hex()  # what it would work out
            yield found

    def digests(self) -> Iterator[bytes]:
        """Yield the key of each cell, as 32 bytes."""
        return (key for _, _, key in self._combined())

    def _combined(self) -> Iterator[tuple[tuple[int, ...], Cell, bytes]]:
        """Yield for each cell which entries it is of, a cell with the same crossed fields, and its key."""
        for chosen in product(*(range(len(entries)) for entries in self._lists)):
            cell, common = self._common(chosen)
            pieces = common.copy()
            for entries, k in zip(self._pieces, chosen, strict=True):
                for place, piece in entries[k]:
                    pieces[place] = piece
            yield chosen, cell, hashlib.sha256(f"{{{','.join(pieces)}}}".encode()).digest()

    def _common(self, chosen: tuple[int, ...]) -> tuple[Cell, list[str]]:
        """Return a cell with the crossed fields of some entries, and its fields as JSON."""
        crossed = tuple(-1 if is_loose else k for is_loose, k in zip(self._loose, chosen, strict=True))
        found = self._known.get(crossed)
        if found is None:
            spec: dict[str, Any] = {}
            for entries, k in zip(self._lists, chosen, strict=True):
                spec |= entries[k]
            cell = self._make(spec)
            found = cell, [_piece(name, getattr(cell, name)) for name in NAMES]
            if len(self._known) >= KEPT:
                self._known.clear()
            self._known[crossed] = found
        return found


def _piece(name: str, value: Any) -> str:
    return f'"{name}":{json_of(value)}'
