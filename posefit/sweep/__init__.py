"""Comparative sweeps: many runs, with results that survive crashes.

    plan = Plan.read("plan.toml")        # or Plan.of({...}); ValueError if it is wrong
    frame = Ledger("results").frame()    # after `posefit sweep plan.toml --out results`

A plan (plan.py) consists of cells (cell.py). A cell is one track or one search. All
cells are checked before any of them runs (check.py).

A driver (drive.py) passes the cells to an engine (engine.py), which runs them in other
processes: of this machine (pool.py), or of Dask's workers (cluster.py).
The driver writes each result as a row of a ledger, an SQLite file. Rows are checked
when they are read.

| looking for | file |
|---|---|
| the cells of a plan, and their checks | plan.py, cell.py, check.py |
| installed versions, compared with those of a cell | versions.py |
| parts of a plan, for several machines | shard.py |
| the steps of `posefit sweep`, and its preview | command.py, preview.py |
| the loop that runs cells and writes their outcomes | drive.py |
| the processes that run cells | engine.py, pool.py, worker.py, serve.py, cluster.py |
| reading a ledger, writing one, its tables | ledger.py, writer.py, schema.py |
| who may write to a ledger, and what SQLite's errors mean | lock.py, errors.py |
| a ledger's rows as a table or a CSV file | table.py |
| running a row again, with or without a ledger | repeat.py |

A cell's motion and instance determine its observations (`posefit.motion.instances`), so
all methods see the same ones and can be compared in pairs. `posefit.report` does that.
"""
