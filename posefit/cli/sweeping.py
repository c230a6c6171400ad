"""`posefit sweep`, `posefit report` and `posefit rerun`."""

import re
from contextlib import nullcontext
from typing import Any

import click

from posefit.cli.options import ENGINE, JSON, QUIET, options
from posefit.cli.output import print_result, results_alone, say


@click.command()
@click.argument("plan")
@click.option(
    "--out",
    metavar="DIR",
    help="The ledger's folder: a new one, or one that a sweep goes on in.",
)
@click.option(
    "--shard",
    metavar="I/N",
    help="Run the Ith of N shards of the cells, into a file of its own in DIR.",
)
@options(ENGINE)
@click.option(
    "--dry-run",
    is_flag=True,
    help="Print the cells and about how long they take; run a few frames of each method alone.",
)
@click.option(
    "--retry-quarantined", is_flag=True, help="Try cells again that were quarantined."
)
@QUIET
@JSON
def sweep(
    plan: str,
    out: str | None,
    shard: str | None,
    dry_run: bool,
    retry_quarantined: bool,
    quiet: bool,
    as_json: bool,
    **places: Any,
) -> None:
    """Run the cells of PLAN: methods, motions, views, corruptions and seeds; or single searches of a suite.

    PLAN is a .toml file, `default`, or - for standard input. A sweep may be killed at any moment: the same command goes
    on where it was. Several may share a plan and a DIR as shards.
    Exit status 1 where cells were quarantined after three attempts, 130 where it was stopped.
    """
    from posefit.sweep import command
    from posefit.sweep import preview as previewing
    from posefit.sweep.engine import Limits
    from posefit.sweep.plan import Plan
    from posefit.sweep.pool import cores

    seconds = places.pop("cell_seconds")
    gigabytes = places.pop("cell_gigabytes")
    start = command.engine(Limits(seconds, gigabytes), **places)
    if dry_run:
        with results_alone() if as_json else nullcontext():  # a plugin may print, too
            preview = previewing.preview(plan, out, shard)
        line = previewing.time_line(preview.seconds, places["workers"] or cores())
        value = {"cells": preview.cells, "seconds": preview.seconds}
        return print_result([*preview.lines, line], value, as_json)
    if out is None:
        raise click.UsageError("--out must name a folder for the results, got none")
    with results_alone() if as_json else nullcontext():
        how = {"retry_quarantined": retry_quarantined, "quiet": quiet}
        command.file_of(shard)
        cells = Plan.read(plan)
        tell = (lambda _: None) if quiet else say
        # without an engine there is no folder
        tally = command.swept(cells, out, start(), tell, shard=shard, **how)
    print_result(command.tally_lines(tally, out), {"out": out, **vars(tally)}, as_json)
    click.get_current_context().exit(
        130 if tally.stopped else 1 if tally.quarantined else 0
    )


@click.command()
@click.argument("ledger", metavar="DIR...", nargs=-1, required=True)
@click.option("--out", metavar="FILE.html", help="The page.")
@click.option("--csv", metavar="FILE", help="A file of all rows.")
@click.option(
    "--figures",
    metavar="DIR",
    help="A folder for figures of a paper; needs posefit[figures].",
)
@click.option("--latex", metavar="FILE", help="The leaderboard as a LaTeX table.")
@click.option(
    "--methods",
    metavar="NAMES",
    multiple=True,
    help="Compare these methods alone, such as sapso@pca,cma@pca.",
)
@click.option(
    "--latest",
    is_flag=True,
    help="Of methods that differ only in version, compare the latest alone.",
)
@JSON
def report(
    ledger: tuple[str, ...],
    out: str | None,
    methods: tuple[str, ...],
    as_json: bool,
    **others: Any,
) -> None:
    """Write the results of sweeps to DIR as one page that any browser opens, offline.

    Each DIR is a folder of ledgers (.sqlite), or one of them.

    Without --out it prints the leaderboard and what it shows, and writes no page. What an earlier report wrote is
    replaced, nothing else is.

    It may be written while the sweep goes on, of the cells that are done.
    """
    from posefit.report.write import leaderboard_lines, write_report

    summary = write_report(ledger, out, methods=_names(methods), **others)
    print_result(leaderboard_lines(summary), summary, as_json)


def _names(texts: tuple[str, ...]) -> list[str]:
    """Return the names of methods in the texts of an option: commas separate them, but not in brackets."""
    parts = [part for text in texts for part in re.split(r",(?![^(]*\))", text)]
    return [part.strip() for part in parts if part.strip()]


@click.command()
@click.argument("ledger", metavar="DIR")
@click.argument("key")
@click.option("--out", metavar="DIR", help="A folder for the ledger of the new row.")
@JSON
def rerun(ledger: str, key: str, out: str | None, as_json: bool) -> None:
    """Run one row of the results in DIR again, and print which figures differ.

    KEY is the row's key as the report shows it, or as many of its first digits as no other row has.
    Exit status 1 if a figure other than a time differs.
    """
    from posefit.report import repeat

    with results_alone() if as_json else nullcontext():
        differences = repeat.rerun(ledger, key, out)
    lines = differences or ["every figure but the times is the same"]
    value = {"same": not differences, "differences": differences}
    print_result(lines, value, as_json)
    click.get_current_context().exit(1 if differences else 0)
