"""The command that runs one row of a ledger again: a plan of one cell, on standard input."""

from collections.abc import Mapping
from typing import Any

from posefit.sweep.cell import setting_text
from posefit.sweep.check import FIELDS

LAST = ("instance", "seed")  # what rows of one head differ by
_BEGIN = "posefit sweep - --out rerun <<'END'\n"
_ESCAPES = {'"': '\\"', "\\": "\\\\"}


def repeat_command(spec: Mapping[str, Any]) -> str:
    """Return what a shell runs to get the row of a cell's spec again, in the ledger `rerun`."""
    return command_head(spec) + "".join(f"{name} = {spec[name]}\n" for name in LAST) + "END"


def command_head(spec: Mapping[str, Any]) -> str:
    """Return the command up to the lines for the instance and the seed, and the line END, which follow.

    The shell reads the plan as it is, whatever names it holds: each of its lines begins with a field's name.
    """
    lines = [f"{name} = {_toml(_plain(name, spec[name]))}\n" for name in FIELDS if name in spec and name not in LAST]
    return _BEGIN + "[[cells]]\n" + "".join(lines)


def search_command(spec: Mapping[str, Any]) -> str:
    """Return what a shell runs to get the row of a single search again, in the ledger `rerun`."""
    plan = {
        "suite": spec["suite"],
        "methods": [{"method": spec["method"], "settings": spec["settings"]}],
        **{f"{name}s": [spec[name]] for name in ("function", "dimension", "instance", "seed")},
        "budgets": [spec["evaluations"] // spec["dimension"]],
        "infeasible": spec["infeasible"],
    }
    return _BEGIN + "".join(f"{name} = {_toml(value)}\n" for name, value in plan.items()) + "END"


def _plain(name: str, value: Any) -> Any:
    """Return a field's value without null, which TOML has not: settings are read from their text again."""
    return {one: setting_text(what) for one, what in value.items()} if name == "settings" else value


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_string(name)} = {_toml(one)}" for name, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return _string(value) if isinstance(value, str) else str(value)


def _string(text: str) -> str:
    return '"' + "".join(_ESCAPES.get(sign) or _sign(sign) for sign in text) + '"'


def _sign(sign: str) -> str:
    return f"\\u{ord(sign):04x}" if ord(sign) < 32 or 127 <= ord(sign) < 160 or sign in "\u2028\u2029" else sign
