"""Comparative sweeps: many runs, with results that survive crashes.

    plan = Plan.read("plan.toml")        # or Plan.of({...}); ValueError if it is wrong
    frame = Ledger("results").frame()    # after `posefit sweep plan.toml --out results`

A plan (plan.py) consists of cells (cell.py). A cell is one track or one search. All
cells are checked before any of them runs (check.py).

A driver (drive.py) passes the cells to an engine (engine.py), which runs them in other
processes: of this machine (pool.py and worker.py), or of Dask's workers (cluster.py).
The driver writes each result as a row of a ledger, an SQLite file (ledger.py). Rows are
checked when they are read.

A cell's motion and instance determine its observations (`posefit.motion.instances`), so
all methods see the same ones and can be compared in pairs. `posefit.report` does that.
"""
