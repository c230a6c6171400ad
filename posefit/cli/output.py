"""Where commands say what they do: messages and progress go to stderr, results alone to stdout."""

import json
import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

import click

from posefit.errors import STOPPED, InputError, printable
from posefit.limits import allowed_bytes

MISTAKE = 2  # the exit status of a mistake, which is shown in one line


def open_streams() -> None:
    """Open the standard streams that are closed, on nothing."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115, as long as the process lives


def drop(stream: int) -> None:
    """Send to nowhere what a standard stream holds and still gets: there is no room for it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream)


def say(message: str) -> None:
    """Print a message on stderr. Where that is full, it is lost, and the work goes on."""
    try:
        click.echo("\n".join(map(printable, message.split("\n"))), err=True)
    except OSError:
        drop(2)


def print_result(lines: Iterable[str], value: Any, as_json: bool) -> None:
    """Print lines, or else a value, as one line of JSON."""
    for line in [json.dumps(value)] if as_json else map(printable, lines):
        click.echo(line)


class Command(click.Command):
    """Shows a user's mistakes in one line on stderr; other errors have a traceback."""

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
            # a fault, no file that a user named
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
    """Return what a user reads of an error."""
    if isinstance(error, click.UsageError):
        return error.format_message()
    if isinstance(error, OSError) and isinstance(error.filename, str):
        return f"{error.filename}: expected a file or folder that can be used, got {error.strerror}"
    if isinstance(error, MemoryError):
        return f"expected work that fits {allowed_bytes() / 1e9:.3g} GB of memory, got {str(error) or 'more'}"
    return str(error)


def progress(steps: Iterator[Any], count: int, unit: str = "frame") -> Iterator[Any]:
    """Yield steps, of which there are `count`, with a bar on stderr where that is a terminal."""
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
    """Send to stderr what anything prints in the body, compiled code and other processes too: stdout is for results."""
    sys.stdout.flush()
    with redirect_stdout(sys.stderr):
        stdout_copy = os.dup(1)
        os.dup2(2, 1)
        try:
            yield
        finally:
            os.dup2(stdout_copy, 1)
            os.close(stdout_copy)
