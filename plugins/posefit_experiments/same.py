"""Compares two reports of an experiment: `python -m posefit_experiments.same BEFORE.json AFTER.json`.

Every value but the times must be the same, to the last bit; claims that one method takes less time than another rest on
times. Prints what is not the same, and ends with status 1.
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

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
    """Return where two files of JSON differ, but for the times."""
    first, second = (json.loads(path.read_text(encoding="utf-8")) for path in (before, after))
    return list(differences(first, second))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python -m posefit_experiments.same BEFORE.json AFTER.json")
    found = report_differences(Path(sys.argv[1]), Path(sys.argv[2]))
    print("\n".join(found) or "the same, but for the times")
    sys.exit(bool(found))
