"""The best costs that are known of some problems, from a file that `posefit suite audit --write` made."""

import json
from functools import lru_cache
from importlib.resources import files
from typing import Any


@lru_cache(maxsize=1)
def known_file() -> dict[str, Any]:
    """Return what the file holds: how it was made, and `best`, a cost by a problem's id."""
    found: dict[str, Any] = json.loads((files("posefit.suites") / "known.json").read_text(encoding="utf-8"))
    return found


def best_known_of(problem: str) -> float | None:
    """Return the best cost known of a problem by its id; None where nobody has looked."""
    return known_file()["best"].get(problem)  # type: ignore[no-any-return]
