"""Where commands say what they do: messages and progress go to stderr, results alone to stdout."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

import click

from posefit.errors import InputError, printable

MISTAKE = 2  # the exit status of a mistake, which is shown in one line


def say(message: str) -> None:
    """Print a message on stderr."""
    click.echo("\n".join(map(printable, message.split("\n"))), err=True)


class Command(click.Command):
    """Shows a user's mistakes in one line on stderr; other errors have a traceback."""

    def invoke(self, context: click.Context) -> Any:
        """Run a command."""
        try:
            return super().invoke(context)
        except (click.UsageError, InputError, OSError, ImportError) as error:
            unnamed = isinstance(error, OSError) and error.filename is None  # a fault, no file that a user named
            if unnamed or context.params.get("debug"):
                raise
            message = error.format_message() if isinstance(error, click.UsageError) else str(error)
            say(f"posefit: {' '.join(message.split())}")
            context.exit(MISTAKE)


def progress(steps: Iterator[Any], count: int, unit: str = "frame") -> Iterator[Any]:
    """Yield steps, of which there are `count`, with a bar on stderr where that is a terminal."""
    from tqdm import tqdm

    return iter(tqdm(steps, total=count, unit=unit, file=sys.stderr, dynamic_ncols=True, disable=None))


@contextmanager
def results_alone() -> Iterator[None]:
    """Send to stderr what anything prints in the body, compiled code and other processes too: stdout is for results."""
    sys.stdout.flush()
    with redirect_stdout(sys.stderr):
        kept = os.dup(1)
        os.dup2(2, 1)
        try:
            yield
        finally:
            os.dup2(kept, 1)
            os.close(kept)
