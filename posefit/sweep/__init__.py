"""Comparative sweeps: many runs that cannot be lost.

    from posefit.sweep.plan import Plan
    from posefit.sweep.ledger import Ledger

    plan = Plan.read("plan.toml")                     # or Plan.of({...}); every mistake is found here
    frame = Ledger("results").frame()                 # what `posefit sweep plan.toml --out results` measured

`plan` says which cells there are, `cell` what a cell is and runs it, `ledger` keeps what cells measured, `driver` is a
process's right to write to a ledger, `engines` run cells in processes of this machine or on a Dask cluster, and `drive`
is the loop. `reporting` writes the page that shows what was found: `runs` are the rows as numbers, `contest` holds
methods against each other, `curves` and `gallery` are what is drawn, and the folder `page` is the page itself.
"""
