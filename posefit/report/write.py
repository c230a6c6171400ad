"""What `posefit report` does: a page, and where they are asked for figures, tables and files for other tools."""

from collections.abc import Callable, Iterator
from math import comb
from pathlib import Path
from typing import Any

from posefit.files import check_new, check_place, replaceable, replaced_file
from posefit.geometry.skeleton import ANGLES
from posefit.page.document import plain
from posefit.report.content import data_of
from posefit.report.page.webpage import MARK, document
from posefit.report.runs import runs_of
from posefit.report.search.rows import holds_searches, searches_of
from posefit.report.search.write import board_lines, write_searches
from posefit.sweep.ledger import Ledger

NAMED = 20  # instances that are named where they are not compared
ALIKE = "methods that share a letter are not told apart: Wilcoxon's signed ranks on paired {}, Holm over {}, 5 %"

Say = Callable[[str], None]


def write_report(
    path: str,
    out: str | None,
    *,
    figures: str | None = None,
    iohprofiler: str | None = None,
    csv: str | None = None,
    say: Say,
) -> dict[str, Any]:
    """Write the report of a ledger to a file, and return its answer, leaderboard, baselines, claims and selection.

    Where `out` is None no page is written. An earlier report of that name is replaced; nothing else is. `figures` is a
    new folder for figures (PNG, PDF) and tables (LaTeX, CSV), `iohprofiler` one for IOHprofiler's files, `csv` a new
    file of all rows. Raises ValueError where the ledger has no finished row or something cannot be written, and
    ImportError where figures need matplotlib: before anything is written, if that can be known.
    """
    _check(Path(path), out, [figures, iohprofiler, csv])
    if figures is not None:
        from posefit.report.figures import check_figure

        check_figure("any.png")
    ledger = Ledger(path, say)
    if holds_searches(ledger):
        return _searches(ledger, out, {"figures": figures, "iohprofiler": iohprofiler}, csv)
    runs = runs_of(ledger)
    data = data_of(ledger, runs, say)
    if out is not None:
        with replaced_file(out, MARK.encode()) as building:
            building.write_text(document(data), encoding="utf-8", newline="\n")
    if figures is not None:
        from posefit.report.portfolio import write_portfolio

        write_portfolio(runs, figures)
    if iohprofiler is not None:
        _write_iohprofiler(ledger, iohprofiler)
    if csv is not None:
        _write_csv(ledger, csv)
    said = {name: data.get(name) for name in ("header", "answer", "leaderboard", "baselines", "claims", "selection")}
    gaps = [
        {"instance": runs.instances[one["instance"]], "missing": [runs.methods[m] for m in one["missing"]]}
        for one in data["header"]["dropped"]
    ]
    return {"out": out, **dict(plain(said)), "gaps": gaps}


def _searches(ledger: Ledger, out: str | None, others: dict[str, str | None], csv: str | None) -> dict[str, Any]:
    """Write the report of single searches, and return what it says."""
    for name, place in others.items():
        if place is not None:
            table = f": posefit suite table {ledger.path} --iohprofiler" if name == "iohprofiler" else ""
            raise ValueError(f"--{name} must be given with a sweep of tracks, got one of single searches{table}")
    found = write_searches(searches_of(ledger), out)
    if csv is not None:
        _write_csv(ledger, csv)
    return found


def leaderboard_lines(found: dict[str, Any]) -> list[str]:
    """Return the lines that the command prints: who leads, what is left out, the leaderboard, and where a page is."""
    board = found["leaderboard"] or []
    searched = "times" in found
    lines = board_lines(board) if searched else _board_lines(board)
    if any(row["letters"] for row in board):
        lines.append(ALIKE.format("instances" if searched else "runs", _pairs(board)))
    answer = [found["answer"]] if found["answer"] else []
    written = [] if found["out"] is None else [_written(found["out"])]
    return [*answer, *_gap_lines(found["header"], found["gaps"]), *lines, *written]


def _pairs(board: list[dict[str, Any]]) -> str:
    return _counted(comb(sum(row["taking_part"] for row in board), 2), "pair")


def _board_lines(board: list[dict[str, Any]]) -> list[str]:
    lines = []
    for row in board:
        ends = "" if row["low"] is None else f"{row['low']:.2f} to {row['high']:.2f}"
        skill = "-" if row["skill_mean_pose"] is None else f"{row['skill_mean_pose']:.2f}"
        error = "-" if row["error"] is None else f"{row['error']:.2f}"
        lines.append(f"{row['name'][:32]:32} {error:>9} {ends:>15} {skill:>7}  {row['letters']}".rstrip())
    head = f"{'':32} {'error deg':>9} {'95 % interval':>15} {'skill':>7}"
    return [f"{head}  alike" if any(row["letters"] for row in board) else head, *lines] if lines else []


def _gap_lines(header: dict[str, Any], gaps: list[dict[str, Any]]) -> list[str]:
    """Return the lines that say what failed, and which instances are therefore not compared."""
    lines = []
    if header["failed"]:
        by = ", ".join(f"{method} {count}" for method, count in header["failed_by"].items())
        lines.append(f"{_counted(header['failed'], 'cell')} failed, left out of all figures: {by}")
        lines += [f"  {count} x {reason}" for reason, count in header["reasons"]]
    lines += [header["unpaired"]] if header["unpaired"] else []
    if gaps:
        lines.append(f"left out of the comparison, for every method: {_counted(len(gaps), 'instance')}")
        for gap in gaps[:NAMED]:
            why = f"no run of {', '.join(gap['missing'])}" if gap["missing"] else "no seed in common"
            lines.append(f"  {gap['instance']}: {why}")
        lines += [f"  and {len(gaps) - NAMED} more"] if len(gaps) > NAMED else []
    return lines


def _counted(count: int, word: str) -> str:
    return f"{count} {word}" if count == 1 else f"{count} {word}s"


def _written(out: str) -> str:
    return f"written to {out}: open it in any browser"


def _check(ledger: Path, out: str | None, others: list[str | None]) -> None:
    if out is not None and Path(out).suffix.lower() not in (".html", ".htm"):
        raise ValueError(f"--out must be a file that ends in .html, got {out}")
    if out is not None and not replaceable(Path(out), MARK.encode()):
        raise ValueError(f"{out}: expected a new name or an earlier report, got something else")
    places = [one for one in (out, *others) if one is not None]
    for place in places:
        if Path(place).resolve() == ledger.resolve() or places.count(place) > 1:
            raise ValueError(f"{place}: expected a place of its own for each of what is written, got it twice")
    for other in others:
        if other is not None:
            check_new(other)
    for place in places:
        check_place(place)


def _write_csv(ledger: Ledger, path: str) -> None:
    from posefit.report.export import write_csv
    from posefit.sweep.table import flat

    write_csv(map(flat, ledger.all_rows()), path)


def _write_iohprofiler(ledger: Ledger, path: str) -> None:
    from posefit.report.export import LoggedRun, write_iohprofiler

    def runs() -> Iterator[LoggedRun]:
        for row in ledger.rows():
            spec, trace = row["spec"], row["trace"]
            if not trace["evaluations"]:
                continue
            views = " ".join(f"{view:g}" for view in spec["view_degrees"])
            damage = "".join(f" {kind} {share:g}" for kind, share in sorted(spec["corruption"].items()))
            yield LoggedRun(
                spec["method"],
                {**spec["settings"], **{one: spec[one] for one in ("evaluations", "tracks", "version") if one in spec}},
                f"{spec['motion']} view {views}{damage} frames {spec['frames']} {spec['translation']}",
                row.get("dimensions") or ANGLES,  # a tracker that searches no box has the pose's
                spec["instance"],
                spec["seed"],
                trace["evaluations"],
                trace["cost"],
            )

    write_iohprofiler(runs(), path)
