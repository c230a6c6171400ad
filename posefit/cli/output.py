"""Where commands say what they do: messages and progress go to stderr, results alone to stdout."""

import io
import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, redirect_stdout, suppress
from functools import partial
from typing import Any

import click

from posefit.errors import InputError, printable
from posefit.limits import allowed_bytes

MISTAKE = 2  # the exit status of a mistake, which is shown in one line


class _Messages(io.TextIOWrapper):
    """Standard error: what cannot be written to it is lost, and the work goes on."""

    writing: Callable[[], AbstractContextManager[None]] = staticmethod(partial(suppress, OSError))

    def write(self, text: str) -> int:
        """Write a text."""
        with self.writing():
            super().write(text)
        return len(text)

    def flush(self) -> None:
        """Write what is buffered."""
        with self.writing():
            super().flush()


@contextmanager
def _room() -> Iterator[None]:
    """Raise InputError where the body has no room to write to; a closed pipe ends the output."""
    try:
        yield
    except BrokenPipeError:
        raise
    except OSError as error:
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115, as long as the process lives
        reason = error.strerror or error
        raise InputError(f"standard output: expected room to write results to, got {reason}") from None


class _Results(_Messages):
    """Standard output: a result that cannot be written there is a user's mistake."""

    writing = staticmethod(_room)


def open_streams() -> None:
    """Open the standard streams that are closed, on nothing, and let no full one end the work.

    An open stream is opened again on the same buffer, as the class of a stream cannot be changed.
    """
    for number, (name, kind) in enumerate((("stdin", None), ("stdout", _Results), ("stderr", _Messages))):
        stream = getattr(sys, name)
        if stream is None and os.open(os.devnull, os.O_RDWR) == number:  # the lowest one that is free
            stream = open(number, "w" if kind else "r", encoding="utf-8")  # noqa: SIM115, as long as the process lives
        if kind is not None and isinstance(stream, io.TextIOWrapper):
            lines, unbuffered = stream.line_buffering or kind is _Messages, stream.write_through
            encoding, errors = stream.encoding, stream.errors
            stream = kind(stream.detach(), encoding, errors, line_buffering=lines, write_through=unbuffered)
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)


def say(message: str) -> None:
    """Print a message on stderr."""
    click.echo("\n".join(map(printable, message.split("\n"))), err=True)


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
        except (click.UsageError, InputError, OSError, ImportError, MemoryError) as error:
            unnamed = isinstance(error, OSError) and error.filename is None  # a fault, no file that a user named
            if unnamed or context.params.get("debug"):
                raise
            say(f"posefit: {' '.join(_mistake(error).split())}")
            context.exit(MISTAKE)


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
