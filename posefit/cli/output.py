"""Output of commands: messages and progress go to stderr, only results to stdout."""

import json
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

import click

from posefit.errors import STOPPED, InputError, printable
from posefit.limits import allowed_bytes

MISTAKE = 2  # exit status of a user's mistake, which is shown in one line


def open_streams() -> None:
    """Open standard streams that are closed, on the null device.

    They get their usual numbers where these are free, so that processes started from
    here have them, too: some libraries write to stderr without looking whether it is
    there.
    """
    for number, (name, mode) in enumerate(
        (("stdin", "r"), ("stdout", "w"), ("stderr", "w"))
    ):
        if getattr(sys, name) is not None:
            continue
        null = os.open(os.devnull, os.O_RDWR)
        if null != number and not _is_open(number):
            os.dup2(null, number)
            os.close(null)
            null = number
        os.set_inheritable(null, True)
        # open until the process ends
        setattr(sys, name, open(null, mode))  # noqa: SIM115


def _is_open(number: int) -> bool:
    try:
        os.fstat(number)
    except OSError:
        return False
    return True


def drop(stream: int) -> None:
    """Discard a standard stream's output, because its disk is full."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream)


def say(message: str) -> None:
    """Print a message on stderr. If that is full, the message is lost."""
    try:
        click.echo("\n".join(map(printable, message.split("\n"))), err=True)
    except OSError:
        drop(2)


def print_result(lines: Iterable[str], value: Any, as_json: bool) -> None:
    """Print lines, or with `as_json` a value as one line of JSON."""
    for line in [json.dumps(value)] if as_json else map(printable, lines):
        click.echo(line)


class Command(click.Command):
    """A command that shows a user's mistakes in one line on stderr.

    Other errors show a traceback.
    """

    def invoke(self, context: click.Context) -> Any:
        """Run a command."""
        try:
            return super().invoke(context)
        except (
            click.UsageError,
            InputError,
            OSError,
            ImportError,
            MemoryError,
        ) as error:
            # an OSError without a file name is a fault of the program
            unnamed = isinstance(error, OSError) and error.filename is None
            if unnamed or context.params.get("debug"):
                raise
            say(f"posefit: {' '.join(_mistake(error).split())}")
            context.exit(MISTAKE)
        except KeyboardInterrupt:
            # click would end with 1, as after an error
            say("Aborted!")
            context.exit(STOPPED)


def _mistake(error: BaseException) -> str:
    """Return the message of an error for the user."""
    if isinstance(error, click.UsageError):
        return error.format_message()
    if isinstance(error, OSError) and isinstance(error.filename, str):
        expected = "expected a file or folder that can be used"
        return f"{error.filename}: {expected}, got {error.strerror}"
    if isinstance(error, MemoryError):
        most = f"{allowed_bytes() / 1e9:.3g} GB of memory"
        return f"expected work that fits {most}, got {str(error) or 'more'}"
    return str(error)


def progress(steps: Iterator[Any], count: int, unit: str = "frame") -> Iterator[Any]:
    """Yield `count` steps, with a progress bar if stderr is a terminal."""
    from tqdm import tqdm

    return iter(
        tqdm(
            steps,
            total=count,
            unit=unit,
            file=sys.stderr,
            dynamic_ncols=True,
            disable=None,
        )
    )


@contextmanager
def results_alone() -> Iterator[None]:
    """Send the body's prints to stderr, because stdout is for results.

    That includes compiled code and other processes.
    """
    sys.stdout.flush()
    # compiled code and other processes write to the descriptor, not to `sys.stdout`
    with redirect_stdout(sys.stderr):
        stdout_copy = os.dup(1)
        os.dup2(2, 1)
        try:
            yield
        finally:
            os.dup2(stdout_copy, 1)
            os.close(stdout_copy)
