"""`posefit reproduce` and `posefit bench`.

`posefit --help` imports this package, so its files import click and posefit's own output only; a command imports the
rest when it runs.
"""

from collections.abc import Callable

import click

from posefit import hookimpl
from posefit_reproduce.commands.benchmark import bench_command
from posefit_reproduce.commands.papers import sapso_command, vsmm_command


@click.group("reproduce")
def reproduce_group() -> None:
    """Repeat the experiments of the two publications."""


reproduce_group.add_command(sapso_command)
reproduce_group.add_command(vsmm_command)


@hookimpl
def posefit_register_commands(register: Callable[[click.Command], None]) -> None:
    """Register `reproduce` and `bench`."""
    register(reproduce_group)
    register(bench_command)
