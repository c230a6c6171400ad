"""The papers' experiments, repeated, and posefit's own measurements: `posefit reproduce` and `posefit bench`.

    posefit reproduce sapso        Acta Automatica Sinica 38(5): its tables, figures and claims
    posefit reproduce vsmm         CN101894278: four activities, against an IMM over all models
    posefit reproduce accuracy     one method on clips of CMU, beside what anybody reaches
    posefit reproduce methods      five optimisers in three priors, at one budget
    posefit reproduce views        one camera, two or four
    posefit reproduce degradation  silhouettes that get worse and worse
    posefit reproduce builds       how well a person's build is found
    posefit reproduce footage      a real video, whose truth nobody knows
    posefit reproduce people       people whom a library of motions has never seen
    posefit reproduce lost         which frames are lost, and whether a tracker knows
    posefit bench                  how fast the loop is

Each has `--help`, and `--json` for one JSON object on stdout. `--clips`, or the environment variable POSEFIT_CMU, says
where clips of CMU lie, such as 16/16_17.amc.

Files:

    commands/        the command lines; what a command does is imported when it runs
    grid.py          runs plans of cells, and other jobs, by the engine of `posefit sweep`
    clips.py         names of CMU's clips become paths
    columns.py       heads and digits of the tables
    known.py         tracks of built-in motions, whose truth is known
    sapso/, vsmm/    the papers' experiments
    accuracy.py, methods.py           plans of cells: `--ledger` keeps the rows for `posefit report`
    views.py, degradation.py, builds.py    jobs that no cell can carry, and why
    filmed/          `posefit reproduce footage`
    people/          `posefit reproduce people`
    lost/            `posefit reproduce lost`
    bench/           `posefit bench`
    same.py          compares two reports, but for the times: `python -m posefit_experiments.same BEFORE AFTER`

Anything of posefit and of its plugins may be imported here; nothing imports this package.
"""
