"""Where commands say what they do: messages and progress go to stderr, results alone to stdout."""

import sys
from collections.abc import Iterator
from typing import Any

import click


def say(message: str) -> None:
    """Print a message on stderr."""
    click.echo(message, err=True)


def progress(steps: Iterator[Any], count: int, unit: str = "frame") -> Iterator[Any]:
    """Yield steps, of which there are `count`, with a bar on stderr."""
    from tqdm import tqdm

    return iter(tqdm(steps, total=count, unit=unit, file=sys.stderr, dynamic_ncols=True))
