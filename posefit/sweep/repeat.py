"""Running a cell again: by the key of its row, or by a command that needs no ledger."""

import json
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from posefit.errors import InputError
from posefit.progress import interactive
from posefit.reading import counted, cut, quoted
from posefit.settings import setting_text
from posefit.sweep.cell import run_cell
from posefit.sweep.check import FIELDS
from posefit.sweep.command import swept
from posefit.sweep.engine import Limits
from posefit.sweep.ledger import Ledger
from posefit.sweep.plan import Plan
from posefit.sweep.pool import Pool
from posefit.sweep.table import flat

TIMES = ("seconds", "seconds_per_frame", "cpu_seconds_per_frame")
MAX_SHOWN = 12  # the most differing figures that are listed
# a command consists of one of these beginnings, the lines of a plan, and the end
BEGIN = "posefit sweep - --out rerun <<'END'\n"
TRACK_BEGIN = f"{BEGIN}[[cells]]\n"
END = "END"
# characters that JSON does not escape, but TOML or a terminal does not allow
_ESCAPES = {code: f"\\u{code:04x}" for code in (*range(0x7F, 0xA0), 0x2028, 0x2029)}


def rerun(ledger: str | Path, key: str, out: str | Path | None = None) -> list[str]:
    """Run the cell of a ledger's row again, and return the differences.

    Args:
        ledger: A folder of ledgers, or a ledger.
        key: The row's key, or enough of its first digits to distinguish it.
        out: The folder of a ledger for the new row. By default it is not stored.

    Returns:
        Lines about the versions and the figures that differ. Times may differ. There
        are no lines if all else is equal.

    Raises:
        ValueError: No row or several have the key, the cell cannot be planned with this
            version of posefit, or `out` has its row already.
        KeyboardInterrupt: The user stopped it before the cell had ended.
    """
    earlier = _row_of(ledger, key)
    plan = Plan.of(plan_tables(earlier["spec"]))
    with TemporaryDirectory(prefix="posefit-") as temporary:
        folder = Path(temporary) / "rerun" if out is None else Path(out)
        pool = Pool(1, Limits(), run_cell)
        tally = swept(plan, folder, pool, interactive().log, quiet=True)
        if tally.stopped:
            raise KeyboardInterrupt
        # otherwise the earlier row would be compared with itself
        if not (tally.ran or tally.failed):
            raise InputError(
                "--out must be a new folder or a ledger without this cell, "
                f"got {folder}, which has it"
            )
        (cell,) = plan
        now = _row_of(folder, cell.key)
    return differences(earlier, now)


def _row_of(ledger: str | Path, key: str) -> dict[str, Any]:
    """Return the one row of a ledger whose key begins with the given digits."""
    if not key:
        raise InputError("KEY must be the first digits of a row's key, got none")
    with Ledger(ledger) as results:
        rows = [row for row in results.all_rows() if row["key"].startswith(key)]
    if not rows:
        raise InputError(
            f"{ledger}: expected a row whose key begins with {quoted(key)}, got none: "
            "the keys are in the report, and in its CSV"
        )
    if len(rows) > 1:
        raise InputError(
            f"{ledger}: expected one row whose key begins with {quoted(key)}, "
            f"got {len(rows):,}: give more digits"
        )
    return rows[0]


def differences(earlier: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """Return lines about the differences between two rows of a cell."""
    before = flat(earlier)
    after = flat(now)
    lines = []
    if before["version"] != after["version"]:
        lines.append(
            f"it was run by {cut(before['version'])}, "
            f"and now by {cut(after['version'])}"
        )
    if now["status"] != "done":
        return [*lines, f"it failed: {'; '.join(now['reasons'])}"]
    if earlier["status"] != "done":
        return [*lines, "it had failed, and is done now"]
    differing = []
    # a figure that is unknown in one of them has other columns there
    for name in {**after, **before}:
        if name in (*TIMES, "key", "version"):
            continue
        if before.get(name) != after.get(name):
            differing.append(name)
    for name in differing[:MAX_SHOWN]:
        lines.append(f"{name}: {before.get(name)} before, {after.get(name)} now")
    if len(differing) > MAX_SHOWN:
        more = counted(len(differing) - MAX_SHOWN, "other figure")
        lines.append(f"{more} differ, too")
    return lines


def plan_tables(spec: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of a plan whose only cell has this spec."""
    if spec["kind"] == "track":
        return {"cells": [track_fields(spec)]}
    method = {"method": spec["method"], "settings": _texts(spec["settings"])}
    if spec["name"]:
        method["name"] = spec["name"]
    return {
        "suite": spec["suite"],
        "methods": [method],
        "functions": [spec["function"]],
        "dimensions": [spec["dimension"]],
        "instances": [spec["instance"]],
        "seeds": [spec["seed"]],
        "budgets": [spec["evaluations"] // spec["dimension"]],
        "infeasible": spec["infeasible"],
    }


def track_fields(spec: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a plan's cell that a spec, or a part of one, has."""
    fields = {name: spec[name] for name in FIELDS if name in spec}
    if not fields.get("name", True):
        del fields["name"]
    if "settings" in fields:
        fields["settings"] = _texts(fields["settings"])
    return fields


def _texts(settings: Mapping[str, Any]) -> dict[str, str]:
    """Return settings as texts, which a plan parses: TOML has no null."""
    return {name: setting_text(value) for name, value in settings.items()}


def repeat_command(spec: Mapping[str, Any]) -> str:
    """Return a shell command that runs a spec's cell again, into the folder `rerun`.

    The plan is a quoted here-document, which the shell does not interpret. Each of its
    lines begins with a field's name, so no value can end it.
    """
    if spec["kind"] == "track":
        return f"{TRACK_BEGIN}{plan_lines(track_fields(spec))}{END}"
    return f"{BEGIN}{plan_lines(plan_tables(spec))}{END}"


def plan_lines(fields: Mapping[str, Any]) -> str:
    """Return a line of TOML for each field."""
    return "".join(f"{name} = {_toml(value)}\n" for name, value in fields.items())


def _toml(value: Any) -> str:
    if isinstance(value, Mapping):
        items = [f"{_string(name)} = {_toml(item)}" for name, item in value.items()]
        return f"{{ {', '.join(items)} }}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return _string(value) if isinstance(value, str) else str(value)


def _string(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).translate(_ESCAPES)
