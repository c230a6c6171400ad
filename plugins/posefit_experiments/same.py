"""Compares two reports of an experiment, or two ledgers: `python -m posefit_experiments.same BEFORE AFTER`.

Every value but the times must be the same, to the last bit; claims that one method takes less time than another rest on
times. Rows of ledgers are matched by what was run, whatever version of posefit ran it, and the joints of their frames
are compared too. Prints what is not the same, and ends with status 1.
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from posefit.sweep.ledger import Ledger

TIME, ENDS = "seconds", ("_ms", "_us")  # what the name of a time holds, or ends with
TIMED = "takes less time"  # of a claim: what it says rests on times


def differences(before: Any, after: Any, place: str = "") -> Iterator[str]:
    """Yield where two values that JSON holds differ, but for times and for claims about them."""
    if isinstance(before, dict) and isinstance(after, dict):
        if TIMED in str(before.get("text", "")) and before["text"] == after.get("text"):
            return
        for name in sorted({*before, *after}):
            if TIME in name or name.endswith(ENDS):
                continue
            if name not in before or name not in after:
                yield f"{place}.{name}: only {'after' if name in after else 'before'}"
            else:
                yield from differences(before[name], after[name], f"{place}.{name}")
    elif isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        for k, pair in enumerate(zip(before, after, strict=True)):
            yield from differences(*pair, f"{place}[{k}]")
    elif type(before) is not type(after) or before != after:
        yield f"{place}: {before!r} became {after!r}"


def report_differences(before: Path, after: Path) -> list[str]:
    """Return where two files of JSON, or the rows of two ledgers, differ, but for the times."""
    return list(differences(_content(before), _content(after)))


def _content(path: Path) -> Any:
    return _rows(Ledger(path)) if path.is_dir() else json.loads(path.read_text(encoding="utf-8"))


def _rows(ledger: Ledger) -> dict[str, Any]:
    """Return the rows of a ledger by what was run, with a checksum of their joints instead of where these stand."""
    rows = {}
    for row in ledger.rows():
        spec = {name: value for name, value in row["spec"].items() if name != "version"}
        told = {name: value for name, value in row.items() if name not in ("key", "spec", "joints")}
        rows[json.dumps(spec, sort_keys=True)] = told | {"joints": row["joints"][-1]}
    return rows


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python -m posefit_experiments.same BEFORE AFTER, two reports (.json) or two ledgers")
    try:
        found = report_differences(Path(sys.argv[1]), Path(sys.argv[2]))
    except (OSError, ValueError) as error:
        print(f"same: {error}", file=sys.stderr)
        sys.exit(2)
    print("\n".join(found) or "the same, but for the times")
    sys.exit(bool(found))
