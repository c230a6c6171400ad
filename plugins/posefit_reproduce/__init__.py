"""The experiments of the two publications, and the benchmark.

    posefit reproduce sapso  Acta Automatica Sinica 38(5): tables, figures, claims,
                             and the effect of each part of the method
    posefit reproduce vsmm   CN101894278: four activities, by default and to the
                             letter, compared with an IMM over all models
    posefit bench            the speed of the loop

Other measurements are scripts in the repository's folder `docs/studies`.

    commands.py     the command lines
        experiment.py   what both share: stored runs, from which tables, claims and
                        figures are made
        sapso/, vsmm/   the experiments; `sapso/letter.py` has the optimiser
                        `sapso-letter`
        bench/          the benchmark
        jobs.py         runs jobs in the worker processes of `posefit sweep`
"""

from posefit import hookimpl
from posefit.hooks import RegisterCommand, RegisterOptimiser


@hookimpl
def posefit_register_commands(register: RegisterCommand) -> None:
    """Register `reproduce` and `bench`."""
    from posefit_reproduce.commands import bench_command, reproduce_group

    register(reproduce_group)
    register(bench_command)


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Register `sapso-letter`, which the SAPSO reproduction compares with `sapso`."""
    from posefit_reproduce.sapso.letter import LetterSAPSO

    register("sapso-letter", LetterSAPSO)
