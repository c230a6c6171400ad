"""The command line.

Messages and progress go to stderr, results to stdout. A user's mistake is one line and
exit status 2. The commands are in `tracking`, `sweeping`, `motions`, `suite` and
`plugins`; plugins add others, see `posefit.hooks`. A command imports its modules only
when it runs.
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

THREAD_SECONDS = 1.0  # how long threads may continue after a command
GROUPS: dict[str, tuple[click.Command, ...]] = {
    "Follow a person": (tracking.track, tracking.fit, tracking.extract),
    "Compare methods": (sweeping.sweep, sweeping.report, sweeping.rerun, suite.suite),
    "Inspect": (motions, plugins.plugins, plugins.check),
}


class _Commands(Command, Group):
    """The commands of posefit and of plugins."""

    def list_commands(self, _context: click.Context) -> list[str]:
        """Return the names of all commands, plugins' commands last."""
        return [*self.commands, *_added()]

    def format_commands(
        self, _context: click.Context, formatter: click.HelpFormatter
    ) -> None:
        """Write the commands by purpose, each with its whole first sentence.

        The commands of plugins come last.
        """
        groups = GROUPS | {"From plugins": tuple(_added().values())}
        for heading, commands in groups.items():
            rows = []
            for command in commands:
                first = (command.help or "").split("\n\n")[0]
                rows.append((command.name or "", " ".join(first.split())))
            with formatter.section(heading):
                formatter.write_dl(rows)

    def get_command(self, _context: click.Context, name: str) -> click.Command | None:
        """Return a command, or None. Plugins are loaded only if posefit has none."""
        return self.commands.get(name) or _added().get(name)


def _added() -> dict[str, click.Command]:
    from posefit.registry import COMMAND, plugins_of

    commands = {}
    for plugin in plugins_of((COMMAND,), tuple(main.commands)):
        for command in plugin.commands:
            commands[command.name or ""] = command
    return commands


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="posefit")
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
def main(debug: bool) -> None:
    """Recover a person's 3D motion from masks, by search.

    \b
    posefit track walk --out walk           a first track: open walk/track.html
    posefit track video.mp4 --out walker    a person against a still background
    posefit sweep default --out results     compare eight methods
    """  # noqa: D301
    if debug:
        import logging

        # also for an error that only causes a warning, such as a failed picture
        logger = logging.getLogger("posefit")
        logger.setLevel(logging.DEBUG)
        logger.addHandler(logging.StreamHandler())


for _command in chain.from_iterable(GROUPS.values()):
    main.add_command(_command)


def run() -> None:
    """Run the command, and end the process even if a plugin left a thread running."""
    open_streams()
    warn_in_one_line()
    try:
        main()
    except OSError as error:
        # only a standard stream on a full disk raises this error without a file name
        if error.errno != errno.ENOSPC or error.filename is not None:
            raise
        drop(1)
        say(
            "posefit: standard output: expected room to write results to, "
            f"got {error.strerror}"
        )
        raise SystemExit(MISTAKE) from None
    except SystemExit as end:
        # Python waits for every thread that is not a daemon, so a thread that a plugin
        # left running could keep the process alive forever
        running = []
        for thread in threading.enumerate():
            own = thread.name.startswith(f"{POOL}_")
            if not (thread is threading.main_thread() or thread.daemon or own):
                running.append(thread)
        for thread in running:
            thread.join(THREAD_SECONDS / len(running))
        alive = {thread.name for thread in running if thread.is_alive()}
        if alive:
            names = cut(", ".join(sorted(alive)))
            say(f"posefit: not waiting for threads that a plugin left running: {names}")
            sys.stdout.flush()
            # an ordinary exit would wait for the threads
            if isinstance(end.code, int):
                os._exit(end.code)
            os._exit(0 if end.code is None else 1)
        raise
