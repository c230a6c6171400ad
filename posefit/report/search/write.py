"""What `posefit report` does with a ledger of single searches: the page, rows as CSV, and the lines it prints."""

from typing import Any

from posefit.files import replaced_file
from posefit.page.document import plain
from posefit.report.page.webpage import MARK
from posefit.report.search.content import data_of_searches
from posefit.report.search.page.webpage import search_document
from posefit.report.search.rows import Searches

_SAID = ("header", "answer", "leaderboard", "baselines", "times")


def write_searches(searches: Searches, out: str | None) -> dict[str, Any]:
    """Write the page of single searches to a file, and return its answer, leaderboard, baselines and running times.

    Without a file to write to there is no page.
    """
    data = data_of_searches(searches)
    if out is not None:
        with replaced_file(out, MARK.encode()) as building:
            building.write_text(search_document(data), encoding="utf-8", newline="\n")
    gaps = [
        {
            "instance": data["instances"][one["instance"]]["name"],
            "missing": [searches.methods[m] for m in one["missing"]],
        }
        for one in data["header"]["dropped"]
    ]
    return {"out": out, **dict(plain({name: data.get(name) for name in _SAID})), "gaps": gaps}


def board_lines(board: list[dict[str, Any]]) -> list[str]:
    """Return the lines of a leaderboard of single searches, with a head."""
    lines = [f"{'':32} {'targets %':>9} {'95 % interval':>15} {'above':>7}  alike"] if board else []
    for row in board:
        ends = "" if row["low"] is None else f"{row['low']:.1f} to {row['high']:.1f}"
        figures = f"{row['reached']:>9.1f} {ends:>15} {row['above']:>7.2f}"
        lines.append(f"{row['name'][:32]:32} {figures}  {row['letters']}".rstrip())
    return lines
