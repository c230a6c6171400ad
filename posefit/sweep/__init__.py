"""Comparative sweeps: many runs that cannot be lost.

    plan = Plan.read("plan.toml")                     # or Plan.of({...}); raises ValueError for every mistake
    frame = Ledger("results").frame()                 # what `posefit sweep plan.toml --out results` measured

A plan (plan.py) consists of cells (cell.py), tracks or single searches, all checked before anything runs (check.py).
A driver (driver.py) leases cells, has an engine run them (engines/), and writes their rows to a ledger (ledger.py), in
a log of its own (log.py). A row is written whole, with a checksum, and stays as it is. The observations of a cell
follow from its motion and instance (`posefit.footage.instance`), so that methods are paired. `posefit.report` compares
them.
"""
