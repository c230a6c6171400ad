"""What `posefit report` does: a page, and on request figures, tables and files for other tools."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from posefit.errors import InputError
from posefit.evaluation.measures import BASELINES
from posefit.files import check_new, check_place, replaceable, replaced_file
from posefit.page.document import plain
from posefit.reading import counted, cut
from posefit.report.content import data_of
from posefit.report.export import logged_runs, write_csv, write_iohprofiler
from posefit.report.page import MARK, document
from posefit.report.runs import runs_of
from posefit.sweep.ledger import Ledger
from posefit.sweep.table import flat

MAX_MISSING = 20  # instances that are named if they are not compared
SKILL_OF = "mean_pose"  # the baseline that the printed skill compares with
PRINTED = ("header", "answer", "leaderboard", "baselines", "times")


def write_report(
    path: str | Sequence[str],
    out: str | None,
    *,
    figures: str | None = None,
    iohprofiler: str | None = None,
    csv: str | None = None,
    warn: Callable[[str], None],
) -> dict[str, Any]:
    """Write the report of a ledger, or of several together, to a file, and return what the command prints.

    That is the header, the answer, the leaderboard, the baselines, and the running times of single searches. Without
    `out` no page is written; an earlier report of that name is replaced, nothing else is. `figures` is a new folder for
    figures (PNG, PDF) and tables (LaTeX, CSV), `iohprofiler` one for IOHprofiler's files, `csv` a new file of all rows.
    Raises ValueError where the ledger has no finished row or something cannot be written, and ImportError where figures
    need matplotlib: before anything is written, if possible.
    """
    paths = [path] if isinstance(path, str | Path) else path
    _check_places(Path(paths[0]), out, [figures, iohprofiler, csv])
    if figures is not None:
        from posefit.report.figures import library, write_figures

        library("figure")
    ledger = Ledger(*paths)
    runs = runs_of(ledger)
    if runs.is_search and (figures is not None or iohprofiler is not None):
        name = "iohprofiler" if figures is None else "figures"
        table = f": posefit suite table {ledger.path} --iohprofiler" if name == "iohprofiler" else ""
        raise InputError(f"--{name} must be given with a sweep of tracks, got one of single searches{table}")
    data = data_of(ledger, runs, warn)
    if out is not None:
        with replaced_file(out, MARK.encode()) as building:
            building.write_text(document(data), encoding="utf-8", newline="\n")
    if figures is not None:
        write_figures(runs, figures)
    if iohprofiler is not None:
        write_iohprofiler(logged_runs(ledger), iohprofiler)
    if csv is not None:
        write_csv(map(flat, ledger.all_rows()), csv)
    return {
        "out": out,
        **dict(plain({name: data[name] for name in PRINTED if name in data})),
        "gaps": data["header"]["dropped"],
    }


def leaderboard_lines(report: dict[str, Any]) -> list[str]:
    """Return the lines that the command prints: the leader, what is left out, the leaderboard, and the page's place."""
    lines = [*report["answer"]] if report.get("leaderboard") else []
    lines += _gap_lines(report["header"])
    lines += _board_lines(report)
    return lines if report["out"] is None else [*lines, f"written to {report['out']}: open it in any browser"]


def _board_lines(report: dict[str, Any]) -> list[str]:
    """Return the leaderboard and, below it, the baselines that skills compare with."""
    board = report.get("leaderboard") or []
    if not board:
        return []
    score, digits = ("reached", 1) if "reached" in board[0] else ("error", 2)

    def number(name: str, digits: int, factor: float = 1.0) -> Callable[[dict[str, Any]], str]:
        return lambda row: "-" if row.get(name) is None else f"{factor * row[name]:z.{digits}f}"

    def interval(row: dict[str, Any]) -> str:
        return "" if row["low"] is None else f"{row['low']:.{digits}f} to {row['high']:.{digits}f}"

    columns: dict[str, Callable[[dict[str, Any]], str]] = {
        {"error": "error deg", "reached": "targets %"}[score]: number(score, digits),
        "  95 % interval": interval,
        "  behind": number("behind", digits),
        "      p": number("p", 3),
    }
    if score == "reached":
        columns["   above"] = number("above", 2)
    else:
        columns[" lost in"] = lambda row: f"{row['lost_tracks']}/{row['runs']}"
        columns |= {"  lost %": number("lost", 1, 100.0), "   skill": number(f"skill_{SKILL_OF}", 2)}
    width = max(len(BASELINES[SKILL_OF]), *(len(row["name"]) for row in board))
    lines = [f"{'':{width}} {' '.join(columns)}"]
    for row in board:
        cells = [f"{show(row):>{len(title)}}" for title, show in columns.items()]
        lines.append(f"{row['name']:{width}} {' '.join(cells)}")
    compared = [row for row in report["baselines"] if row["baseline"] == SKILL_OF and row["error"] is not None]
    return lines + [f"{BASELINES[SKILL_OF]:{width}} {row['error']:9.2f}" for row in compared]


def _gap_lines(header: dict[str, Any]) -> list[str]:
    """Return the lines about failures, and the instances that are therefore not compared."""
    lines = []
    if header["failed"]:
        by = "; ".join(f"{method} {count}" for method, count in header["failed_by"].items())
        lines.append(f"{counted(header['failed'], 'cell')} failed, left out of all figures: {by}")
        lines += [f"  {count} x {reason}" for reason, count in header["reasons"]]
    lines += [header["unpaired"]] if header["unpaired"] else []
    if gaps := header["dropped"]:
        lines.append(f"left out of the comparison, for every method: {counted(len(gaps), 'instance')}")
        for gap in gaps[:MAX_MISSING]:
            why = f"no run of {'; '.join(gap['missing'])}" if gap["missing"] else "no seed in common"
            lines.append(f"  {gap['instance']}: {why}")
        lines += [f"  and {len(gaps) - MAX_MISSING} more"] if len(gaps) > MAX_MISSING else []
    return lines


def _check_places(ledger: Path, out: str | None, others: list[str | None]) -> None:
    if out is not None and Path(out).suffix.lower() not in (".html", ".htm"):
        raise InputError(f"--out must be a file that ends in .html, got {cut(out)}")
    if out is not None and not replaceable(Path(out), MARK.encode()):
        raise InputError(f"{out}: expected a new name or an earlier report, got something else")
    places = [place for place in (out, *others) if place is not None]
    for place in places:
        if Path(place).resolve() == ledger.resolve() or places.count(place) > 1:
            raise InputError(f"{place}: expected a place of its own for each of what is written, got it twice")
        if place != out:
            check_new(place)
    for place in places:
        check_place(place)
