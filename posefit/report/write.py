"""The command `posefit report`: a page, and on request figures, a CSV and a table."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from posefit.errors import InputError
from posefit.files import check_new, check_place, check_replaceable, replaced_file
from posefit.page.document import plain
from posefit.reading import cut
from posefit.report.coco import write_coco
from posefit.report.content import data_of
from posefit.report.contest import Runs
from posefit.report.leaderboard import standings_of
from posefit.report.page import MARK, document
from posefit.report.reading import is_of, runs_of
from posefit.report.table import LATEX_MARK, board_lines, latex_table
from posefit.sweep.ledger import Ledger
from posefit.sweep.repeat import repeat_command
from posefit.sweep.table import flat, write_csv

PRINTED = ("header", "answer", "leaderboard", "baselines", "times")
CSV_MARK = "key,version,status,"  # how the CSV of a sweep begins


class Report(NamedTuple):
    """What the command `posefit report` prints: as lines, or as data."""

    lines: list[str]
    data: dict[str, Any]


def write_report(
    path: str | Sequence[str],
    out: str | None,
    *,
    figures: str | None = None,
    csv: str | None = None,
    latex: str | None = None,
    coco: str | None = None,
    methods: Sequence[str] = (),
    latest: bool = False,
) -> Report:
    """Write the report of a ledger, or of several together.

    Files of an earlier report are replaced. Other files never are.

    Args:
        path: A ledger, a folder of ledgers, or several of these.
        out: The page. With None no page is written.
        figures: A folder for figures (PNG, PDF) and the leaderboard (CSV).
        csv: A file of all rows of these methods.
        latex: A file of the leaderboard as a LaTeX table.
        coco: A new folder of single searches as COCO's files.
        methods: The methods to compare, by their names in the report or in the plan.
            All if empty.
        latest: Whether to compare only the latest version of each method.

    Returns:
        What the command prints. The lines have the leader, the problems, the
        leaderboard, and the path of the page. The data have the header, the answer, the
        leaderboard, the baselines, and the running times of single searches.

    Raises:
        ValueError: The ledger has no finished row, or a file cannot be written. As far
            as possible, this is checked before anything is written.
        ImportError: Figures are asked for, and matplotlib is not installed.
    """
    paths = [path] if isinstance(path, str | Path) else path
    if out is not None and Path(out).suffix.lower() not in (".html", ".htm"):
        raise InputError(f"--out must be a file that ends in .html, got {cut(out)}")
    for file, mark in ((out, MARK), (csv, CSV_MARK), (latex, LATEX_MARK)):
        if file is not None:
            check_replaceable(file, mark.encode())
    _check_distinct(Path(paths[0]), [out, figures, csv, latex, coco])
    if coco is not None:
        check_new(coco)
    if figures is not None:
        from posefit.report.figures import check_folder, empty_figure, write_figures

        check_folder(figures)
        empty_figure()
    with Ledger(*paths) as ledger:
        runs = runs_of(ledger, methods, latest=latest)
        if runs.kind.name == "search" and figures is not None:
            raise InputError(
                "--figures must be given with a sweep of tracks, "
                "got one of single searches"
            )
        if runs.kind.name != "search" and coco is not None:
            raise InputError(
                "--coco must be given with a sweep of single searches, "
                "got one of tracks"
            )
        standings = standings_of(runs)
        for option, place in (("--figures", figures), ("--latex", latex)):
            if place is not None and standings is None:
                raise InputError(f"{option} must be of runs with errors, got none")
        data = data_of(ledger, runs, standings)
        if out is not None:
            _write(out, MARK, document(data))
        if figures is not None and standings is not None:
            write_figures(standings, figures)
        if csv is not None:
            with replaced_file(csv, CSV_MARK.encode()) as building:
                write_csv(_csv_rows(ledger, runs), building)
        if coco is not None:
            write_coco(runs, coco)
        if latex is not None and standings is not None:
            _write(latex, LATEX_MARK, [latex_table(standings)])
    lines = []
    if standings is not None:
        lines += data["answer"]
    for text, details in data["header"]["problems"]:
        lines += [text, *(f"  {detail}" for detail in details)]
    if standings is not None:
        lines += board_lines(standings)
    if out is not None:
        lines.append(f"written to {out}: open it in any browser")
    printed = plain({name: data[name] for name in PRINTED if name in data})
    return Report(lines, {"out": out, "kind": runs.kind.name, **dict(printed)})


def _write(path: str, mark: str, parts: Iterable[str]) -> None:
    """Write texts as a new file, or in place of an earlier one with this mark."""
    with (
        replaced_file(path, mark.encode()) as building,
        building.open("w", encoding="utf-8", newline="\n") as file,
    ):
        file.writelines(parts)


def _csv_rows(ledger: Ledger, runs: Runs) -> Iterator[dict[str, Any]]:
    """Yield the rows of the CSV file, which are those of the report's methods.

    They also have the figures that are computed from a row, and the command that
    repeats it.
    """
    for row in ledger.all_rows():
        if not is_of(runs, row["spec"]):
            continue
        columns = flat(row)
        if row["status"] == "done":
            columns |= runs.kind.computed(row)
        yield {**columns, "command": repeat_command(row["spec"])}


def _check_distinct(ledger: Path, places: Sequence[str | None]) -> None:
    """Raise InputError if a path is used twice, or its folder does not exist."""
    paths = [place for place in places if place is not None]
    resolved = [Path(place).resolve() for place in paths]
    for place, path in zip(paths, resolved, strict=True):
        if path == ledger.resolve() or resolved.count(path) > 1:
            raise InputError(
                f"two outputs, or an output and the ledger, have the same path: {place}"
            )
    for place in paths:
        check_place(place)
