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
    help="Folder of the ledger: new, or of a sweep to continue.",
)
@click.option(
    "--shard",
    metavar="I/N",
    help="Run only the Ith of N shards of the cells, into a separate file in DIR.",
)
@options(ENGINE)
@click.option(
    "--dry-run",
    is_flag=True,
    help="Print the cells and a time estimate from a few frames of each method.",
)
@click.option("--retry-quarantined", is_flag=True, help="Run quarantined cells again.")
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
    """Run the cells of PLAN: methods on motions with views, corruptions and seeds.

    A cell may also be a single search of a suite.
    PLAN is a .toml file, `default`, or - for standard input. A sweep may be killed at
    any moment: the same command continues it. Several processes may share a plan and a
    DIR as shards.
    The exit status is 1 if cells were quarantined after three attempts, 130 if the
    sweep was stopped.
    """
    from posefit.silhouette.sharing import cores
    from posefit.sweep import command
    from posefit.sweep import preview as previewing
    from posefit.sweep.engine import Limits
    from posefit.sweep.plan import Plan
    from posefit.sweep.shard import file_of

    seconds = places.pop("cell_seconds")
    gigabytes = places.pop("cell_gigabytes")
    limits = Limits(seconds, gigabytes)
    start = command.engine_starter(limits, **places)
    if dry_run:
        # a plugin may print, too
        with results_alone() if as_json else nullcontext():
            preview = previewing.preview(plan, out, shard, limits)
        line = previewing.time_line(preview.seconds, places["workers"] or cores())
        value = {"cells": preview.cells, "seconds": preview.seconds}
        return print_result([*preview.lines, line], value, as_json)
    if out is None:
        raise click.UsageError("--out must name a folder for the results, got none")
    with results_alone() if as_json else nullcontext():
        how = {"retry_quarantined": retry_quarantined, "quiet": quiet}
        # before the plan is read, which may take seconds
        file_of(shard)
        cells = Plan.read(plan)
        tell = (lambda _: None) if quiet else say
        # the engine starts before the folder is made: if it fails, there is no folder
        tally = command.swept(cells, out, start(), tell, shard=shard, **how)
    print_result(command.tally_lines(tally, out), {"out": out, **vars(tally)}, as_json)
    context = click.get_current_context()
    # what a shell reports for a program that Ctrl-C has ended
    if tally.stopped:
        context.exit(130)
    context.exit(1 if tally.quarantined else 0)


@click.command()
@click.argument("ledger", metavar="DIR...", nargs=-1, required=True)
@click.option("--out", metavar="FILE.html", help="The page.")
@click.option(
    "--csv",
    metavar="FILE",
    help="Write all rows, or those of --methods, to this file.",
)
@click.option(
    "--figures",
    metavar="DIR",
    help="Write figures for a paper to this folder; needs posefit[figures].",
)
@click.option("--latex", metavar="FILE", help="Write the leaderboard as a LaTeX table.")
@click.option(
    "--coco",
    metavar="DIR",
    help="Write single searches to this new folder as files that COCO's cocopp reads.",
)
@click.option(
    "--methods",
    metavar="NAMES",
    multiple=True,
    help="Compare only these methods, such as sapso@pca,cma@pca.",
)
@click.option(
    "--latest",
    is_flag=True,
    help="If methods differ only in version, compare only the latest.",
)
@JSON
def report(
    ledger: tuple[str, ...],
    out: str | None,
    methods: tuple[str, ...],
    as_json: bool,
    **others: Any,
) -> None:
    """Write a report on the sweeps in DIR: a web page that needs no network.

    Each DIR is a folder of ledgers (.sqlite), or one ledger.

    Without --out the leaderboard is printed and no page is written. The files of an
    earlier report are replaced; other files are never replaced.

    A report may be written during a sweep. It then covers the finished cells.
    """
    from posefit.report.write import write_report

    report = write_report(ledger, out, methods=_names(methods), **others)
    print_result(report.lines, report.data, as_json)


def _names(texts: tuple[str, ...]) -> list[str]:
    """Return the names of methods in an option's texts.

    Commas separate them, except in brackets.
    """
    names = []
    # names may have brackets with settings, and commas in them
    for text in texts:
        for part in re.split(r",(?![^(]*\))", text):
            if part.strip():
                names.append(part.strip())
    return names


@click.command()
@click.argument("ledger", metavar="DIR")
@click.argument("key")
@click.option("--out", metavar="DIR", help="A folder for the ledger of the new row.")
@JSON
def rerun(ledger: str, key: str, out: str | None, as_json: bool) -> None:
    """Run one row of the results in DIR again, and print the figures that differ.

    KEY is the row's key in the report, or its first digits.
    The exit status is 1 if a figure other than a time differs.
    """
    from posefit.sweep import repeat

    with results_alone() if as_json else nullcontext():
        differences = repeat.rerun(ledger, key, out)
    lines = differences or ["every figure but the times is the same"]
    value = {"same": not differences, "differences": differences}
    print_result(lines, value, as_json)
    click.get_current_context().exit(1 if differences else 0)
