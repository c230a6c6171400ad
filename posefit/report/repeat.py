"""The command that runs one row of a ledger again: a plan of one cell, on standard input."""

import json
from collections.abc import Mapping
from typing import Any

from posefit.settings import setting_text
from posefit.sweep.check import FIELDS

LAST_FIELDS = ("instance", "seed")  # the fields that rows with the same head differ in
_BEGIN = "posefit sweep - --out rerun <<'END'\n"
# beyond those of JSON
_ESCAPES = {code: f"\\u{code:04x}" for code in (*range(0x7F, 0xA0), 0x2028, 0x2029)}


def repeat_command(spec: Mapping[str, Any]) -> str:
    """Return the shell command that runs the cell of a spec again, with the ledger `rerun`."""
    if spec["kind"] == "track":
        return (
            command_head(spec)
            + "".join(f"{name} = {_toml(spec[name])}\n" for name in LAST_FIELDS)
            + "END"
        )
    plan = {
        "suite": spec["suite"],
        "methods": [
            {
                name: spec[name]
                for name in ("method", "name", "settings")
                if name != "name" or spec[name]
            }
        ],
        **{
            f"{name}s": [spec[name]]
            for name in ("function", "dimension", "instance", "seed")
        },
        "budgets": [spec["evaluations"] // spec["dimension"]],
        "infeasible": spec["infeasible"],
    }
    return (
        _BEGIN
        + "".join(f"{name} = {_toml(value)}\n" for name, value in plan.items())
        + "END"
    )


def command_head(spec: Mapping[str, Any]) -> str:
    """Return a track's command up to the lines of instance and seed; the line END follows these.

    The shell does not interpret the plan, whatever names it holds: each of its lines begins with a field's name.
    """
    fields = {
        name: spec[name] for name in FIELDS if name in spec and name not in LAST_FIELDS
    }
    fields = {name: value for name, value in fields.items() if name != "name" or value}
    # TOML has no null: settings are parsed from their text
    fields["settings"] = {
        name: setting_text(value) for name, value in spec["settings"].items()
    }
    return (
        _BEGIN
        + "[[cells]]\n"
        + "".join(f"{name} = {_toml(value)}\n" for name, value in fields.items())
    )


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        return (
            "{ "
            + ", ".join(
                f"{_string(name)} = {_toml(item)}" for name, item in value.items()
            )
            + " }"
        )
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return _string(value) if isinstance(value, str) else str(value)


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).translate(_ESCAPES)
