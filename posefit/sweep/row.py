"""Checks a row of a ledger where it is read: JSON of the shape that cells and measures have, of finite numbers."""

import json
import marshal
from typing import Any

from posefit.errors import InputError
from posefit.fitting.check import one_of, whole
from posefit.geometry.skeleton import JOINTS
from posefit.reading import quoted
from posefit.suites.functions import checked_address
from posefit.suites.problem import INFEASIBLE
from posefit.sweep.cell import SearchCell, TrackCell
from posefit.sweep.check import CHECKS

LARGEST = 1e30  # of a number: its square is finite, and so is itself in 32 bits
MAX_KNOWN_SPECS = 10_000  # in memory, of those that were checked
SCALAR, FIGURE = object(), object()  # what a setting may be, and a figure: a number, or some by their names
# A value that stands for all of its type; in a list or a table, of all of its elements
_MAPPINGS = {"settings": {"": SCALAR}, "corruption": {"": 0.0}, "files": {"": ""}}
SPECS: dict[str, dict[str, Any]] = {
    "track": {**TrackCell("", "", ("",)).spec, **_MAPPINGS},
    "search": {**SearchCell("", "", 1, 9, 0, 1).spec, "settings": {"": SCALAR}},
}
_ROW = {"warnings": [""], "trace": {"": [0.0]}}
ROWS: dict[str, dict[str, Any]] = {
    "track": {**_ROW, "joint_errors_mm": [0.0], "mode_reliability": [[0.0]]},
    "search": {**_ROW, "cost": 0.0, "truth_cost": 0.0},
}
_known_specs: set[bytes] = set()


def checked_row(key: str, spec: str, status: str, faults: str, row: str | None) -> dict[str, Any]:
    """Return a row of a ledger as a mapping. Raises InputError saying what was expected instead."""
    values = _parsed(spec)
    one_of("kind", kind := str(values.get("kind")), SPECS)
    same = marshal.dumps({**values, "seed": 0, "instance": 0}, 2)  # thousands of rows differ in nothing else
    _check(values, SPECS[kind], ("seed", "instance") if same in _known_specs else ())
    if kind == "search":
        checked_address(*(values[name] for name in ("suite", "function", "instance", "dimension")))
        one_of("infeasible", values["infeasible"], INFEASIBLE)
    for name in ("seed", "instance", "evaluations") if kind == "search" else CHECKS.keys() - {"motion", "train"}:
        if name not in ("method", "settings"):
            whole(name, values[name], name == "evaluations") if kind == "search" else CHECKS[name](name, values[name])
    if len(_known_specs) < MAX_KNOWN_SPECS:
        _known_specs.add(same)
    if status != "done":
        reasons = _parsed('{"reasons": ' + faults + "}")
        _check(reasons, {"reasons": [""]})
        return {"key": key, "spec": values, "status": "quarantined", **reasons}
    figures = _parsed(row or "")
    _check(figures, ROWS[kind] | dict.fromkeys(figures.keys() - ROWS[kind], FIGURE))
    trace = figures["trace"]
    used, costs = trace.get("evaluations", [0]), trace.get("cost", [])
    rising = used == sorted(set(used)) and all(number >= 1 for number in used) and costs == sorted(costs, reverse=True)
    if len(trace) != 2 or not rising or len(used) != len(costs) or (not used and kind == "search"):
        raise InputError(f"trace must be rising evaluations from 1 and the best cost after each, got {quoted(trace)}")
    errors, bins = figures.get("joint_errors_mm", [0.0] * len(JOINTS)), figures.get("mode_reliability", [])
    if len(errors) != len(JOINTS) or any(len(values) != 3 or not 0 <= values[1] <= 1 for values in bins):
        raise InputError(f"joint_errors_mm must be {len(JOINTS)} numbers, and mode_reliability triples, got others")
    return {"key": key, "spec": values, "status": "done", **figures}


def _parsed(text: str) -> dict[str, Any]:
    try:
        values = json.loads(text)
        json.dumps(values, ensure_ascii=False, allow_nan=False).encode()  # finite numbers, whole characters
    except (ValueError, TypeError, RecursionError) as error:
        raise InputError(f"expected JSON of finite numbers and whole characters, got {quoted(str(error))}") from None
    if not isinstance(values, dict):
        raise InputError(f"expected a table of values, got {quoted(values)}")
    return values


def _check(values: dict[str, Any], models: dict[str, Any], names: tuple[str, ...] = ()) -> None:
    if values.keys() != models.keys():
        wrong = min(values.keys() ^ models.keys())
        raise InputError(
            f"a row must hold what posefit writes, got {'one more' if wrong in values else 'none'}: {quoted(wrong)}"
        )
    for name in names or models:
        if not _like(values[name], models[name], name != "seed"):
            raise InputError(f"{name} must be what posefit writes, got {quoted(values[name])}")


def _like(value: Any, model: Any, bounded: bool = True) -> bool:
    """Return whether a value has the type and shape of its model, and numbers of a size."""
    if model is FIGURE:
        return value is None or _like(value, {"": None} if isinstance(value, dict) else 0.0)
    if model is None or model is SCALAR:
        parts = value if model is SCALAR and isinstance(value, list) else [value]
        texts = (str, bool, type(None)) if model is SCALAR else (type(None),)
        return all(isinstance(part, texts) or _like(part, 0.0) for part in parts)
    if isinstance(model, list | dict):
        parts, like = (value, model[0]) if isinstance(model, list) else (getattr(value, "values", list)(), model[""])
        return isinstance(value, type(model)) and all(_like(part, like) for part in parts)
    if isinstance(model, float):
        return type(value) in (int, float) and -LARGEST < value < LARGEST
    return type(value) is type(model) and (not bounded or isinstance(value, str) or -LARGEST < value < LARGEST)
