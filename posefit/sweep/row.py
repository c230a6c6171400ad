"""Checks a row of a ledger where it is read: JSON of the shape that cells and measures have, of finite numbers."""

import json
import marshal
from dataclasses import fields
from types import NoneType
from typing import Any

from posefit.errors import InputError
from posefit.fitting.check import one_of, whole
from posefit.geometry.skeleton import JOINTS
from posefit.reading import quoted
from posefit.suites.functions import checked_address
from posefit.sweep.cell import KINDS
from posefit.sweep.check import CHECKS, SEARCH_CHECKS

LARGEST = 1e30  # of a figure: its square is finite, and so is itself in 32 bits
MAX_KNOWN_SPECS = 10_000  # in memory, of those that were checked
NUMBER = (float, int)
FIGURE = (*NUMBER, NoneType, {"": (*NUMBER, NoneType)})  # or some by their names
SETTING = (*NUMBER, str, bool, NoneType)
# What a value is that no check of a plan's decides: a type, one of several, or a list or table of some
SHAPES: dict[str, Any] = {
    "kind": str, "method": str, "motion": str, "version": str, "train": [str], "files": {"": str},
    "settings": {"": (*SETTING, [SETTING])}, "evaluations": int, "reasons": [str], "warnings": [str],
    "trace": {"": [NUMBER]}, "joint_errors_mm": [NUMBER], "mode_reliability": [[NUMBER]], "truth_cost": NUMBER,
}  # fmt: skip
SPECS = {name: {"kind", *(field.name for field in fields(kind))} for name, kind in KINDS.items()}
ROWS = {"track": {"warnings", "trace", "joint_errors_mm", "mode_reliability"}, "search": {"trace", "truth_cost"}}
_known_specs: set[bytes] = set()


def checked_row(key: str, spec: str, status: str, faults: str, row: str | None) -> dict[str, Any]:
    """Return a row of a ledger as a mapping. Raises InputError saying what was expected instead."""
    values = _parsed(spec)
    one_of("kind", kind := str(values.get("kind")), SPECS)
    _check_names(values, SPECS[kind])
    same = marshal.dumps({**values, "seed": 0, "instance": 0}, 2)  # thousands of rows differ in nothing else
    checks = CHECKS if kind == "track" else SEARCH_CHECKS
    for name in ("seed", "instance") if same in _known_specs else values:
        if name in SHAPES or name not in checks:
            _check_shape(name, values[name])
        elif (checked := checks[name](name, values[name])) != values[name] and list(checked) != values[name]:
            raise InputError(f"{name} must be what posefit writes, got {quoted(values[name])}")
    whole("evaluations", values["evaluations"], 1)
    if kind == "search":
        checked_address(*(values[name] for name in ("suite", "function", "instance", "dimension")))
    if len(_known_specs) < MAX_KNOWN_SPECS:
        _known_specs.add(same)
    figures = _parsed(row or "") if status == "done" else _parsed('{"reasons": ' + faults + "}")
    _check_names(figures, ROWS[kind] | figures.keys() if status == "done" else {"reasons"})
    for name, value in figures.items():
        _check_shape(name, value)
    if status != "done":
        return {"key": key, "spec": values, "status": "quarantined", **figures}
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


def _check_names(values: dict[str, Any], names: set[str]) -> None:
    if values.keys() != names:
        came = "one more" if (wrong := min(values.keys() ^ names)) in values else "none"
        raise InputError(f"a row must hold what posefit writes, got {came}: {quoted(wrong)}")


def _check_shape(name: str, value: Any) -> None:
    if not _has_shape(value, SHAPES.get(name, FIGURE)):
        raise InputError(f"{name} must be what posefit writes, got {quoted(value)}")


def _has_shape(value: Any, shape: Any) -> bool:
    if isinstance(shape, tuple):
        return any(_has_shape(value, choice) for choice in shape)
    if shape == [NUMBER] and isinstance(value, list) and value and {*map(type, value)} <= {*NUMBER}:
        return bool(min(value) > -LARGEST and max(value) < LARGEST)  # at once, as rows hold hundreds of numbers
    if isinstance(shape, list):
        return isinstance(value, list) and all(_has_shape(part, shape[0]) for part in value)
    if isinstance(shape, dict):
        return isinstance(value, dict) and all(_has_shape(part, shape[""]) for part in value.values())
    return type(value) is shape and (shape not in NUMBER or -LARGEST < value < LARGEST)
