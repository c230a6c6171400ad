"""Comparative sweeps: many runs that cannot be lost.

    plan = Plan.read("plan.toml")                     # or Plan.of({...}); raises ValueError for every mistake
    frame = Ledger("results").frame()                 # what `posefit sweep plan.toml --out results` measured

A plan (plan.py) consists of cells (cell.py), tracks or single searches, all checked before anything runs (check.py).
A driver (drive.py) has an engine run them (engine.py: pebble's processes in pool.py and worker.py, Dask's workers in
cluster.py) and writes their rows to a ledger, an SQLite file (ledger.py); rows are checked where they are read. The
observations of a cell follow from its motion and instance (`posefit.motion.instances`), so that methods are paired.
`posefit.report` compares them.
"""
