"""Where commands say what they do: messages and progress go to stderr, results alone to stdout."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import Any

import click

from posefit.errors import printable


def say(message: str) -> None:
    """Print a message on stderr."""
    click.echo("\n".join(map(printable, message.split("\n"))), err=True)


def progress(steps: Iterator[Any], count: int, unit: str = "frame") -> Iterator[Any]:
    """Yield steps, of which there are `count`, with a bar on stderr."""
    from tqdm import tqdm

    return iter(tqdm(steps, total=count, unit=unit, file=sys.stderr, dynamic_ncols=True))


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
