"""The command `posefit report`: a page, and on request figures, a CSV and a table."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from posefit.errors import InputError
from posefit.files import check_new, check_place, check_replaceable, replaced_file
from posefit.page.document import plain
from posefit.reading import cut
from posefit.report.coco import write_coco
from posefit.report.content import data_of
from posefit.report.contest import Runs
from posefit.report.leaderboard import Standings, standings_of
from posefit.report.page import MARK, document
from posefit.report.reading import is_of, runs_of
from posefit.report.table import LATEX_MARK, board_lines, latex_table
from posefit.sweep.ledger import Ledger
from posefit.sweep.repeat import repeat_command
from posefit.sweep.table import flat, write_csv

PRINTED = ("header", "answer", "leaderboard", "baselines", "times")
CSV_MARK = "key,version,status,"  # how the CSV of a sweep begins
# how the files of an earlier report begin, which may be replaced
MARKS = {"--out": MARK, "--csv": CSV_MARK, "--latex": LATEX_MARK}


class Report(NamedTuple):
    """What the command `posefit report` prints: as lines, or as data."""

    lines: list[str]
    data: dict[str, Any]


def write_report(
    path: str | Path | Sequence[str | Path],
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
    options = {
        "--out": out,
        "--figures": figures,
        "--csv": csv,
        "--latex": latex,
        "--coco": coco,
    }
    outputs = {option: to for option, to in options.items() if to is not None}
    _check_paths(paths, outputs)
    with Ledger(*paths) as ledger:
        runs = runs_of(ledger, methods, latest=latest)
        standings = standings_of(runs)
        _check_runs(runs, standings, outputs)
        data = data_of(ledger, runs, standings)
        if out is not None:
            _write(out, MARK, document(data))
        if figures is not None and standings is not None:
            from posefit.report.figures import write_figures

            write_figures(standings, figures)
        if csv is not None:
            with replaced_file(csv, CSV_MARK.encode()) as building:
                write_csv(_csv_rows(ledger, runs), building)
        if coco is not None:
            write_coco(runs, coco)
        if latex is not None and standings is not None:
            _write(latex, LATEX_MARK, [latex_table(standings)])
    lines = _lines(data, standings)
    if out is not None:
        lines.append(f"written to {out}: open it in any browser")
    printed = plain({name: data[name] for name in PRINTED if name in data})
    return Report(lines, {"out": out, "kind": runs.kind.name, **dict(printed)})


def _check_paths(ledgers: Sequence[str | Path], outputs: Mapping[str, str]) -> None:
    """Raise an error if an output cannot be written where it is to be.

    What the ledger contains does not matter here, so this comes before it is read.

    Args:
        ledgers: The ledgers that are read.
        outputs: The path of each output by its option.
    """
    out = outputs.get("--out")
    if out is not None and Path(out).suffix.lower() not in (".html", ".htm"):
        raise InputError(f"--out must be a file that ends in .html, got {cut(out)}")
    for option, mark in MARKS.items():
        if option in outputs:
            check_replaceable(outputs[option], mark.encode())
    _check_distinct(ledgers, outputs.values())
    if "--coco" in outputs:
        check_new(outputs["--coco"])
    if "--figures" in outputs:
        from posefit.report.figures import check_folder, empty_figure

        check_folder(outputs["--figures"])
        empty_figure()  # raises if matplotlib is missing


def _check_runs(
    runs: Runs, standings: Standings | None, options: Collection[str]
) -> None:
    """Raise InputError if the output of an option cannot be made of these runs."""
    is_search = runs.kind.name == "search"
    if is_search and "--figures" in options:
        raise InputError(
            "--figures must be given with a sweep of tracks, got one of single searches"
        )
    if not is_search and "--coco" in options:
        raise InputError(
            "--coco must be given with a sweep of single searches, got one of tracks"
        )
    for option in ("--figures", "--latex"):
        if option in options and standings is None:
            raise InputError(
                f"{option} needs runs whose error is known, got a sweep without any"
            )


def _lines(data: Mapping[str, Any], standings: Standings | None) -> list[str]:
    """Return the printed leader, problems and leaderboard of a page's data."""
    lines = []
    if standings is not None:
        lines += data["answer"]
    for text, details in data["header"]["problems"]:
        lines += [text, *(f"  {detail}" for detail in details)]
    if standings is not None:
        lines += board_lines(standings)
    return lines


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


def _check_distinct(ledgers: Iterable[str | Path], paths: Collection[str]) -> None:
    """Raise InputError if a path is used twice, or its folder does not exist."""
    used = {Path(ledger).resolve() for ledger in ledgers}
    for path in paths:
        resolved = Path(path).resolve()
        if resolved in used:
            raise InputError(
                f"two outputs, or an output and the ledger, have the same path: {path}"
            )
        used.add(resolved)
    for path in paths:
        check_place(path)
