"""The experiments of the two publications, and the benchmark: `posefit reproduce` and `posefit bench`.

    posefit reproduce sapso  Acta Automatica Sinica 38(5): its tables, figures and claims, and what each part is worth
    posefit reproduce vsmm   CN101894278: four activities, by default and to the letter, against an IMM over all models
    posefit bench            how fast the loop is

Other measurements are scripts in the repository's folder `docs/studies`.

    commands.py     the command lines
    experiment.py   the shape of both: runs that are stored, and tables, claims and figures made of them
    sapso/, vsmm/   the experiments; `sapso/letter.py` is an optimiser, `sapso-letter`
    bench/          the benchmark
    jobs.py         runs jobs in processes, by the pool of `posefit sweep`
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
    """Offer `sapso-letter`, which the reproduction of the SAPSO paper compares with `sapso`."""
    from posefit_reproduce.sapso.letter import LetterSAPSO

    register("sapso-letter", LetterSAPSO)
