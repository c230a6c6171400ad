"""`posefit plugins` and `posefit check`."""

from typing import Any

import click

from posefit.cli.group import Group
from posefit.cli.output import print_result, results_alone


@click.group(cls=Group, invoke_without_command=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array.")
@click.pass_context
def plugins(context: click.Context, as_json: bool) -> None:
    """List the installed optimisers, priors, trackers, starts, segmenters and devices.

    The list includes their settings; `show NAME` explains one plugin's settings.
    """
    if context.invoked_subcommand is not None:
        return
    from posefit.cli.inspection import described, listing
    from posefit.registry import KINDS, registry

    # plugins may print while they are imported
    with results_alone():
        offers = registry().offers
    descriptions: list[dict[str, Any]] = []
    for kind in KINDS:
        descriptions += map(described, offers[kind].values())
    print_result(listing(registry()), descriptions, as_json)


@plugins.command()
@click.argument("name")
def show(name: str) -> None:
    """Explain a plugin and its settings, with their types and defaults."""
    from posefit.cli.inspection import explanation
    from posefit.registry import registry

    with results_alone():
        lines = list(explanation(registry(), name))
    click.echo("\n".join(lines))


@plugins.command()
@click.option(
    "-v",
    "--verbose",
    is_flag=True,
    help="Show the traceback of a broken plugin, too.",
)
@click.pass_context
def doctor(context: click.Context, verbose: bool) -> None:
    """Report what every plugin offers, or why it offers nothing.

    The exit status is 1 if a plugin is broken or offers nothing.
    """
    import warnings

    from posefit.cli.inspection import diagnosis
    from posefit.registry import COMMAND, KINDS, plugins_of

    with warnings.catch_warnings():
        # the report below says the same
        warnings.simplefilter("ignore")
        lines, well = diagnosis(plugins_of((*KINDS, COMMAND), _own(context)), verbose)
    click.echo("\n".join(lines))
    context.exit(0 if well else 1)


@plugins.command()
@click.argument("name")
@click.option(
    "--kind",
    default="optimiser",
    show_default=True,
    help="optimiser, prior, tracker, start, segmenter or command.",
)
@click.option("--out", metavar="DIR", help="The new folder; default posefit-NAME.")
@click.pass_context
def new(context: click.Context, /, name: str, kind: Any, out: str | None) -> None:
    """Write a small plugin to start from: it installs, works and has a passing test."""
    from posefit.cli.template import write_plugin

    folder = write_plugin(name, kind, out, _own(context))
    click.echo(
        f"written to {folder}; next: cd {folder} "
        "&& python -m pip install -e '.[test]' && python -m pytest"
    )


@click.command()
@click.argument("kind", metavar="KIND")
@click.argument("name")
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="SETTING=VALUE",
    help="Check it with this setting; repeatable.",
)
@click.option(
    "--only", multiple=True, metavar="RULE", help="Check only this rule; repeatable."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.pass_context
def check(
    context: click.Context,
    kind: Any,
    name: str,
    settings: tuple[str, ...],
    only: tuple[str, ...],
    as_json: bool,
) -> None:
    """Check an installed plugin against the rules of its kind.

    KIND is optimiser, prior, tracker, start or segmenter.
    The rules are checked in a separate process; the plugin's output goes to stderr.
    Once two rules have failed for the same cause, the others are not checked.
    The exit status is 1 if a rule is broken.
    """
    from posefit.fitting.check import one_of
    from posefit.registry import CHECKED_KINDS

    one_of("kind", kind, CHECKED_KINDS)
    with results_alone():
        from posefit.testing.process import check_in_process

        report = check_in_process(kind, name, settings, only)
    results = []
    for result in report.results:
        row = {
            "check": result.name,
            "outcome": result.outcome,
            "detail": result.detail,
            "traceback": result.traceback,
        }
        results.append(row)
    value = {"plugin": report.plugin, "summary": report.summary, "results": results}
    print_result(str(report).split("\n"), value, as_json)
    context.exit(0 if report else 1)


def _own(context: click.Context) -> tuple[str, ...]:
    root = context.find_root().command
    if isinstance(root, click.Group):
        return tuple(root.commands)
    return ()
