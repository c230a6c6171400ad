"""`posefit sweep` and `posefit report`."""

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
    help="Print what cells there are, and run none; with --json each cell.",
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
    from posefit.sweep.engine import Limits
    from posefit.sweep.plan import Plan

    seconds = places.pop("cell_seconds")
    gigabytes = places.pop("cell_gigabytes")
    start = command.engine(Limits(seconds, gigabytes), **places)
    if dry_run:
        with results_alone() if as_json else nullcontext():  # a plugin may print, too
            previewed = command.previewed(plan, out, shard)
            listed = (
                [
                    {"key": cell.key, "done": done, **cell.spec}
                    for cell, done in previewed
                ]
                if as_json
                else []
            )
            lines = command.preview_lines(previewed)
        return print_result(lines, {"cells": listed}, as_json)
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
@click.option(
    "--out", metavar="FILE.html", help="The page; an earlier report is replaced."
)
@click.option(
    "--figures",
    metavar="DIR",
    help="New folder for figures of a paper; needs posefit[figures].",
)
@click.option("--csv", metavar="FILE", help="New file of all rows.")
@JSON
def report(
    ledger: tuple[str, ...], out: str | None, as_json: bool, **others: Any
) -> None:
    """Write the results of sweeps to DIR as one page that any browser opens, offline.

    Each DIR is a folder of ledgers (.sqlite), or one of them.

    Without --out it prints which method leads and the leaderboard, and writes no page.

    It may be written while the sweep goes on, of the cells that are done.
    """
    from posefit.report.write import leaderboard_lines, write_report

    summary = write_report(ledger, out, **others)
    print_result(leaderboard_lines(summary), summary, as_json)
