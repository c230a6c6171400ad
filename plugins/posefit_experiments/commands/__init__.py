"""`posefit reproduce` and `posefit bench`: one file a group of commands.

    papers.py        sapso, vsmm
    measurements.py  accuracy, methods, views, degradation, builds, footage,
                     composites, people, posterior, lost, modes, agents
    benchmark.py     posefit bench
    options.py       options that several of them have

`posefit --help` imports this package, so its files import click and posefit's own output alone; the rest is imported
when a command runs.
"""

from collections.abc import Callable

import click

from posefit import hookimpl
from posefit_experiments.commands import measurements, papers
from posefit_experiments.commands.benchmark import bench_command

REPRODUCED = (
    papers.sapso_command,
    papers.vsmm_command,
    measurements.accuracy_command,
    measurements.methods_command,
    measurements.views_command,
    measurements.degradation_command,
    measurements.builds_command,
    measurements.footage_command,
    measurements.composites_command,
    measurements.people_command,
    measurements.posterior_command,
    measurements.lost_command,
    measurements.modes_command,
    measurements.agents_command,
)


@click.group("reproduce")
def reproduce_group() -> None:
    """Repeat the publications' experiments, and the measurements that the handbook gives."""


for _command in REPRODUCED:
    reproduce_group.add_command(_command)


@hookimpl
def posefit_register_commands(register: Callable[[click.Command], None]) -> None:
    """Offer `reproduce` and `bench`."""
    register(reproduce_group)
    register(bench_command)
