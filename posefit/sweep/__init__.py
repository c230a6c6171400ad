"""Comparative sweeps: many runs that cannot be lost.

    from posefit.sweep.plan import Plan
    from posefit.sweep.ledger import Ledger

    plan = Plan.read("plan.toml")                     # or Plan.of({...}); raises ValueError for every mistake
    frame = Ledger("results").frame()                 # what `posefit sweep plan.toml --out results` measured

| looking for | file |
|---|---|
| what `posefit sweep` does: the engine, the bar, the exit status, the preview | command.py |
| the cells of a plan, of tracks or of single searches | plan.py |
| a million cells of a product, one after the other | product.py |
| what is wrong with a cell, before it runs | check.py |
| what a cell is, a track or a search, how it runs and what it measures | cell.py |
| the loop: lease, run, write the row, until nothing is left | drive.py |
| a process's right to write to a ledger: leases, attempts, quarantine | driver.py |
| the folder of finished rows; the log of one driver, and what a damaged line is | ledger.py, log.py |
| how the logs of dead drivers become one; whether a driver lives | fold.py, locks.py |
| rows as a table of pandas, or as runs of a suite | table.py |
| how long a plan will take | estimate.py |
| where cells run: processes, a Dask cluster, their limits | engines/ |

A row is written whole, with a checksum, and stays as it is. The observations of a cell follow from its motion and
instance (`posefit.footage.instance`), so that methods are paired. `posefit.report` compares them.
"""
