"""What a row of a ledger holds: one schema, made of the fields of a cell and of the measures.

A row is checked once, when it is read; what passes is not checked again. A figure may be missing, or null.
"""

import json
import marshal
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

from posefit.errors import InputError
from posefit.fitting.check import one_of, whole
from posefit.geometry.skeleton import JOINTS
from posefit.reading import quoted
from posefit.suites.functions import checked_address
from posefit.suites.problem import INFEASIBLE
from posefit.sweep.cell import SearchCell, TrackCell
from posefit.sweep.check import CHECKS
from posefit.sweep.table import is_search
from posefit.tracking.measures import Measures

LARGEST = 1e30  # of a number in a row: its square is finite, and so is itself in 32 bits
LARGEST_PLACE = 2**50  # bytes of a file
MAX_KNOWN_SPECS = 10_000  # in memory, of those that were checked
_NUMBERS, _KINDS = frozenset((int, float)), frozenset((int, float, type(None)))
_SCALARS = (str, int, float, bool, type(None))

Check = Callable[[str, Any], object]


def checked_row(key: str, text: bytes) -> dict[str, Any]:
    """Return the finished row of a key from its JSON. Raises InputError saying what was expected instead."""
    row = _parsed(key, text)
    search = check_spec(row["spec"])
    checks = _SEARCH_ROW if search else _TRACK_ROW
    if not checks.keys() <= row.keys():
        raise InputError(f"a row must hold {min(checks.keys() - row.keys())}, got none")
    several = _SEVERAL if search else _TRACK_SEVERAL
    _check_figures({name: value for name, value in row.items() if name not in several})
    for name in _FIGURES:
        if (value := row.get(name)) is not None:
            _figures(name, value)
    for name, check in checks.items():
        check(name, row[name])
    return row


def checked_quarantined(key: str, text: bytes) -> dict[str, Any]:
    """Return a quarantined cell from its JSON: key, spec, status and reasons. Raises InputError as `checked_row`."""
    cell = _parsed(key, text)
    check_spec(cell["spec"])
    _texts("reasons", cell.get("reasons"))
    if cell.keys() != {"key", "spec", "status", "reasons"}:
        raise InputError("a quarantined cell must hold key, spec, status and reasons, got other fields")
    return cell


def check_spec(spec: Any) -> bool:
    """Return whether a spec is that of a search. Raises InputError where it is not that of a cell."""
    if not isinstance(spec, dict):
        raise InputError(f"spec must be the fields of a cell, got {quoted(spec)}")
    search = is_search(spec)
    checks = _SEARCH_SPEC if search else _TRACK_SPEC
    if spec.keys() != checks.keys():
        wrong = spec.keys() ^ checks.keys()
        came = f"{'one' if min(wrong) in spec else 'none'} called {quoted(min(wrong))}"
        raise InputError(f"spec must be the fields of a cell, got {came}")
    same = marshal.dumps({**spec, "seed": 0, "instance": 0}, 2)
    wanted = ("seed", "instance") if same in _known_specs else spec  # thousands of rows differ in nothing else
    for name in wanted:
        value = spec[name]
        checks[name](name, value)
        if name != "seed" and isinstance(value, int | float):
            _number(name, value)
    if search:
        checked_address(*(spec[name] for name in ("suite", "function", "instance", "dimension")))
    if len(_known_specs) < MAX_KNOWN_SPECS:
        _known_specs.add(same)
    return search


def _parsed(key: str, text: bytes) -> dict[str, Any]:
    """Return an object of JSON whose key is right, with a spec."""

    def refuse(constant: str) -> None:
        raise InputError(f"expected finite numbers, got {constant}")

    try:
        row = json.loads(text.decode(), parse_constant=refuse)
    except RecursionError:
        raise InputError("expected values that are not nested so deeply, got too many brackets") from None
    if not isinstance(row, dict) or row.get("key") != key or "spec" not in row:
        raise InputError(f"expected the row of cell {key[:8]} with its spec, got {quoted(row)}")
    if b"\\u" in text:  # one half of a character that takes two
        try:
            json.dumps(row, ensure_ascii=False).encode()
        except UnicodeEncodeError:
            raise InputError("a row must hold whole characters, got half of one") from None
    return row


def _number(name: str, value: Any) -> None:
    if type(value) not in _NUMBERS or not -LARGEST < value < LARGEST:
        raise InputError(f"{name} must be a number, got {quoted(value)}")


def _figures(name: str, value: Any) -> None:
    if not isinstance(value, dict):
        raise InputError(f"{name} must be figures by their names, got {quoted(value)}")
    _check_figures(value)


def _check_figures(figures: Mapping[str, Any]) -> None:
    try:
        quick = (
            _KINDS.issuperset(map(type, figures.values())) and sum(map(abs, filter(None, figures.values()))) < LARGEST
        )
    except OverflowError:  # a whole number beyond all floats
        quick = False
    if not quick:
        for name, value in figures.items():
            if value is not None:
                _number(name, value)


def _check(what: str, holds: Callable[[Any], bool]) -> Check:
    """Return the check that a value, which must be `what`, is so."""

    def check(name: str, value: Any) -> None:
        if not holds(value):
            raise InputError(f"{name} must be {what}, got {quoted(value)}")

    return check


_text = _check("a text", lambda value: isinstance(value, str))
_texts = _check("a list of texts", lambda value: isinstance(value, list) and all(isinstance(one, str) for one in value))


def _settings(name: str, value: Any) -> None:
    if not isinstance(value, dict):
        raise InputError(f"{name} must be values by their names, got {quoted(value)}")
    for setting, one in value.items():
        if not all(isinstance(part, _SCALARS) for part in (one if isinstance(one, list) else [one])):
            raise InputError(f"{name} {setting} must be a value or a list of some, got {quoted(one)}")


def _are_numbers(value: Any) -> bool:
    """Return whether a value is a list of numbers from 0."""
    if type(value) is not list or not _NUMBERS.issuperset(map(type, value)):
        return False
    return not value or 0 <= min(value) <= max(value) < LARGEST


def _trace(name: str, value: Any) -> None:
    if isinstance(value, dict) and value.keys() == {"evaluations", "cost"}:
        used, best = value["evaluations"], value["cost"]
        if type(used) is type(best) is list and len(used) == len(best):
            numbers = {int}.issuperset(map(type, used)) and _NUMBERS.issuperset(map(type, best))
            if numbers and not used:
                return
            rising = (
                numbers and used == sorted(used) and len(used) == len(set(used)) and best == sorted(best, reverse=True)
            )
            if rising and 1 <= used[0] <= used[-1] < LARGEST and LARGEST > best[0] >= best[-1] > -LARGEST:
                return
    raise InputError(f"{name} must be rising evaluations from 1 and the best cost after each, got {quoted(value)}")


def _search_trace(name: str, value: Any) -> None:
    _trace(name, value)
    if not value["cost"]:
        raise InputError(f"{name} of a search must hold a cost, got none")


def _are_bins(value: Any) -> bool:
    return isinstance(value, list) and all(_are_numbers(one) and len(one) == 3 and 0 <= one[1] <= 1 for one in value)


def _is_place(value: Any) -> bool:
    whole_numbers = isinstance(value, list) and len(value) == 3 and set(map(type, value)) == {int}
    return whole_numbers and min(value) >= 0 and max(value) <= LARGEST_PLACE


def _made_of(kind: type, checks: Mapping[str, Check]) -> dict[str, Check]:
    return {one.name: checks[one.name] for one in fields(kind)}


_files = _check(
    "digests by the names of files",
    lambda value: isinstance(value, dict) and all(isinstance(one, str) for one in value.values()),
)
_NAMES = {"method": _text, "version": _text, "settings": _settings}
_TRACK_SPEC = _made_of(TrackCell, {**CHECKS, **_NAMES, "motion": _text, "train": _texts, "files": _files})
_SEARCH_SPEC = _made_of(
    SearchCell,
    {
        **_NAMES,
        **dict.fromkeys(("suite", "function", "dimension", "instance"), lambda *_: None),  # by `checked_address`
        "evaluations": lambda name, value: whole(name, value, 1),
        "infeasible": lambda name, value: one_of(name, value, INFEASIBLE),
        "seed": CHECKS["seed"],
    },
)
_known_specs: set[bytes] = set()
# What a row holds that is not a single figure
_FIGURES = tuple(one.name for one in fields(Measures) if "Mapping" in str(one.type) or "Spread" in str(one.type))
_ROW: dict[str, Check] = {
    "key": _text,
    "spec": lambda *_: None,  # by `check_spec`
    "status": lambda name, value: one_of(name, value, ("done",)),
    "warnings": _texts,
    "trace": _trace,
    "joints": _check("start, length and checksum of the joints", _is_place),
}
_TRACK_ROW = {
    **_ROW,
    "joint_errors_mm": _check(
        f"{len(JOINTS)} numbers", lambda value: _are_numbers(value) and len(value) == len(JOINTS)
    ),
    "mode_reliability": _check("triples of frames, probability and share", _are_bins),
}
_SEARCH_ROW: dict[str, Check] = {**_ROW, "trace": _search_trace, "cost": _number, "truth_cost": _number}
_SEVERAL, _TRACK_SEVERAL = {*_FIGURES, *_SEARCH_ROW}, {*_FIGURES, *_TRACK_ROW}
