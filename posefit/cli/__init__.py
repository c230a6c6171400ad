"""The command line. Messages and progress go to stderr, results to stdout; a mistake is one line and exit status 2.

The commands stand in `tracking`, `sweeping`, `motions`, `suite` and `plugins`; plugins add others, see
`posefit.hooks`. What each does is imported when it runs.
"""

import errno
import os
import sys
import threading
from itertools import chain

import click

from posefit.cli import plugins, suite, sweeping, tracking
from posefit.cli.group import Group
from posefit.cli.motions import motions
from posefit.cli.output import MISTAKE, Command, drop, open_streams, say
from posefit.errors import warn_in_one_line
from posefit.reading import cut
from posefit.silhouette.sharing import POOL
from posefit.version import __version__

THREAD_SECONDS = 1.0  # that threads have to end after a command
GROUPS: dict[str, tuple[click.Command, ...]] = {
    "Follow a person": (tracking.track, tracking.fit, tracking.extract),
    "Compare methods": (sweeping.sweep, sweeping.report, sweeping.rerun, suite.suite),
    "Inspect": (motions, plugins.plugins, plugins.check),
}


class _Commands(Command, Group):
    """Has plugins' commands, too."""

    def list_commands(self, _context: click.Context) -> list[str]:
        """Return the names of all commands: those of plugins come last."""
        return [*self.commands, *_added()]

    def format_commands(
        self, _context: click.Context, formatter: click.HelpFormatter
    ) -> None:
        """Write the commands by what they are for, each with its whole first sentence; those of plugins last."""
        for heading, commands in (
            GROUPS | {"From plugins": tuple(_added().values())}
        ).items():
            with formatter.section(heading):
                first = [
                    " ".join((command.help or "").split("\n\n")[0].split())
                    for command in commands
                ]
                formatter.write_dl(
                    [
                        (command.name or "", text)
                        for command, text in zip(commands, first, strict=True)
                    ]
                )

    def get_command(self, _context: click.Context, name: str) -> click.Command | None:
        """Return a command; plugins are looked at for those alone that posefit does not have itself."""
        return self.commands.get(name) or _added().get(name)


def _added() -> dict[str, click.Command]:
    from posefit.registry import COMMAND, plugins_of

    added = plugins_of((COMMAND,), tuple(main.commands))
    return {
        command.name or "": command for plugin in added for command in plugin.commands
    }


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="posefit")
@click.option(
    "--debug", is_flag=True, help="Show the traceback of a mistake instead of one line."
)
def main(debug: bool) -> None:
    """Recover a person's 3D motion from masks, by searching.

    \b
    posefit track walk --out walk           a first track: open walk/track.html
    posefit track video.mp4 --out walker    a person before a still background
    posefit sweep default --out results     compare eight methods
    """  # noqa: D301


for _command in chain.from_iterable(GROUPS.values()):
    main.add_command(_command)


def run() -> None:
    """Run the command that was asked for, and end the process even where a plugin left a thread running."""
    open_streams()
    warn_in_one_line()
    try:
        main()
    except OSError as error:
        if error.errno != errno.ENOSPC or error.filename is not None:
            raise
        drop(1)
        say(
            f"posefit: standard output: expected room to write results to, got {error.strerror}"
        )
        raise SystemExit(MISTAKE) from None
    except SystemExit as end:
        others = [
            thread
            for thread in threading.enumerate()
            if thread is not threading.main_thread()
        ]
        running = [
            thread
            for thread in others
            if not thread.daemon and not thread.name.startswith(f"{POOL}_")
        ]
        for thread in running:
            thread.join(THREAD_SECONDS / len(running))
        names = ", ".join(
            sorted({thread.name for thread in running if thread.is_alive()})
        )
        if names:
            say(f"posefit: not waiting for what a plugin left running: {cut(names)}")
            sys.stdout.flush()
            os._exit(
                end.code if isinstance(end.code, int) else 0 if end.code is None else 1
            )
        raise
