"""What `posefit report` does: a page, and on request figures, tables and files for other tools."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from posefit.errors import InputError
from posefit.evaluation.measures import BASELINES
from posefit.files import check_new, check_place, replaceable, replaced_file
from posefit.page.document import plain
from posefit.reading import cut
from posefit.report.content import data_of
from posefit.report.page import MARK, document
from posefit.report.runs import runs_of
from posefit.sweep.ledger import Ledger
from posefit.sweep.table import flat, write_csv

SKILL_OF = "mean_pose"  # the baseline that the printed skill compares with
PRINTED = ("header", "answer", "leaderboard", "baselines", "times")


def write_report(
    path: str | Sequence[str],
    out: str | None,
    *,
    figures: str | None = None,
    csv: str | None = None,
) -> dict[str, Any]:
    """Write the report of a ledger, or of several together, to a file, and return what the command prints.

    That is the header, the answer, the leaderboard, the baselines, and the running times of single searches. Without
    `out` no page is written; an earlier report of that name is replaced, nothing else is. `figures` is a new folder for
    figures (PNG, PDF) and the leaderboard (CSV), `csv` a new file of all rows.
    Raises ValueError where the ledger has no finished row or something cannot be written, and ImportError where figures
    need matplotlib: before anything is written, if possible.
    """
    paths = [path] if isinstance(path, str | Path) else path
    _check_places(Path(paths[0]), out, [figures, csv])
    if figures is not None:
        from posefit.report.figures import library, write_figures

        library("figure")
    with Ledger(*paths) as ledger:
        runs = runs_of(ledger)
        if runs.kind.name == "search" and figures is not None:
            raise InputError(
                "--figures must be given with a sweep of tracks, got one of single searches"
            )
        data = data_of(ledger, runs)
        if out is not None:
            with replaced_file(out, MARK.encode()) as building:
                building.write_text(document(data), encoding="utf-8", newline="\n")
        if figures is not None:
            write_figures(runs, figures)
        if csv is not None:
            write_csv(map(flat, ledger.all_rows()), csv)
    return {
        "out": out,
        **dict(plain({name: data[name] for name in PRINTED if name in data})),
        "gaps": data["header"]["dropped"],
    }


def leaderboard_lines(report: dict[str, Any]) -> list[str]:
    """Return the lines that the command prints: the leader, what is left out, the leaderboard, and the page's place."""
    lines = [*report["answer"]] if "leaderboard" in report else []
    for text, details in report["header"]["problems"]:
        lines += [text, *(f"  {detail}" for detail in details)]
    lines += _board_lines(report) if "leaderboard" in report else []
    return (
        lines
        if report["out"] is None
        else [*lines, f"written to {report['out']}: open it in any browser"]
    )


def _board_lines(report: dict[str, Any]) -> list[str]:
    """Return the leaderboard and, below it, the baseline that skills compare with."""
    board = report["leaderboard"]
    score, digits = ("reached", 1) if "reached" in board[0] else ("error", 2)
    title = {"error": "error deg", "reached": "targets %"}[score]

    def number(value: float | None, digits: int) -> str:
        return "-" if value is None else f"{value:z.{digits}f}"

    def cells(row: dict[str, Any]) -> dict[str, str]:
        """Return what stands below each title."""
        ends = (
            ""
            if row["low"] is None
            else f"{row['low']:.{digits}f} to {row['high']:.{digits}f}"
        )
        shown = {title: number(row[score], digits), "  95 % interval": ends}
        shown |= {
            "  behind": number(row["behind"], digits),
            "      p": number(row["p"], 3),
        }
        if score == "reached":
            return {**shown, "   above": number(row["above"], 2)}
        lost = "-" if row["lost"] is None else number(100.0 * row["lost"], 1)
        shown |= {" lost in": f"{row['lost_tracks']}/{row['runs']}", "  lost %": lost}
        return {**shown, "   skill": number(row[f"skill_{SKILL_OF}"], 2)}

    width = max(len(BASELINES[SKILL_OF]), *(len(row["name"]) for row in board))
    lines = [f"{'':{width}} {' '.join(cells(board[0]))}"]
    lines += [
        f"{row['name']:{width}} "
        + " ".join(f"{v:>{len(k)}}" for k, v in cells(row).items())
        for row in board
    ]
    compared = [
        row
        for row in report["baselines"]
        if row["baseline"] == SKILL_OF and row["error"] is not None
    ]
    return lines + [
        f"{BASELINES[SKILL_OF]:{width}} {row['error']:9.2f}" for row in compared
    ]


def _check_places(ledger: Path, out: str | None, others: list[str | None]) -> None:
    if out is not None and Path(out).suffix.lower() not in (".html", ".htm"):
        raise InputError(f"--out must be a file that ends in .html, got {cut(out)}")
    if out is not None and not replaceable(Path(out), MARK.encode()):
        raise InputError(
            f"{out}: expected a new name or an earlier report, got something else"
        )
    places = [place for place in (out, *others) if place is not None]
    for place in places:
        if Path(place).resolve() == ledger.resolve() or places.count(place) > 1:
            raise InputError(
                f"{place}: expected a place of its own for each of what is written, got it twice"
            )
        if place != out:
            check_new(place)
    for place in places:
        check_place(place)
