"""The best costs that are known of some problems, from a file that `posefit suite audit --write` made.

A cost of the file may fall in a later version, and problems may be added; none may rise or go. Nothing else of a suite
ever changes.
"""

from functools import lru_cache
from importlib.resources import files
from typing import Any

from posefit.reading import parsed_json


@lru_cache(maxsize=1)
def known_file() -> dict[str, Any]:
    """Return what the file holds: how it was made, and `best`, a cost by a problem's id."""
    found: dict[str, Any] = parsed_json((files("posefit.suites") / "known.json").read_text(encoding="utf-8"))
    return found


def best_known_of(problem: str) -> float | None:
    """Return the best cost known of a problem by its id; None where nobody has looked."""
    return known_file()["best"].get(problem)  # type: ignore[no-any-return]
