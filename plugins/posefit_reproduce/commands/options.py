"""Options that several experiments have."""

from collections.abc import Callable
from typing import Any

import click

Option = Callable[[Callable[..., Any]], Callable[..., Any]]

JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else on stdout.")
CLIPS = click.option(
    "--clips", envvar="POSEFIT_CMU", metavar="CMU_DIR", help="Folder of CMU clips; by default POSEFIT_CMU."
)
LEDGER = click.option(
    "--ledger", metavar="DIR", help="Where rows are kept: the same command goes on there; see `posefit report`."
)


def seeds(default: int, told: str = "Tracks of each, one a seed.") -> Option:
    """Return the option of how many seeds there are."""
    return click.option("--seeds", type=int, default=default, show_default=True, help=told)


def workers(default: int | None, told: str = "") -> Option:
    """Return the option of how many processes there are; None is one a core."""
    text = "Processes of this machine; one a core by default." if default is None else "Processes of this machine."
    return click.option(
        "--workers", type=int, default=default, show_default=default is not None, metavar="N", help=f"{text} {told}"
    )
