"""Comparative sweeps: many runs that cannot be lost.

    from posefit.sweep.plan import Plan
    from posefit.sweep.ledger import Ledger

    plan = Plan.read("plan.toml")                     # or Plan.of({...}); every mistake is found here
    frame = Ledger("results").frame()                 # what `posefit sweep plan.toml --out results` measured

| looking for | file |
|---|---|
| what `posefit sweep` does: the engine, the bar, the exit status, the preview | command.py |
| which cells there are; every field of a plan | plan.py |
| a million cells of a product, one after the other | product.py |
| what is wrong with a cell, before it runs | check.py |
| what a cell is, how it runs and what it measures | cell.py |
| the loop: lease, run, write the row, until nothing is left | drive.py |
| a process's right to write to a ledger: leases, attempts, quarantine | driver.py |
| the folder of finished rows; the log of one driver, and what a damaged line is | ledger.py, log.py |
| the logs of dead drivers become one; how it is seen that a driver lives | fold.py, locks.py |
| single searches of a numbered benchmark, instead of tracks | single/ |
| rows as a table of pandas | table.py |
| how long a plan will take | estimate.py |
| where cells run: processes, a Dask cluster, their limits | engines/ |

A row is written whole, with a checksum, and stays as it is. What is seen in a cell follows from its motion and
instance (`posefit.footage.instance`), so that methods are paired: all see the same. `posefit.report` says what was
found.
"""
