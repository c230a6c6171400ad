"""Where cells run: engines, which keep no order and no state; the ledger does.

    from contextlib import closing
    from posefit.sweep.cell import run_cell
    from posefit.sweep.engines.limits import Limits
    from posefit.sweep.engines.processes import Processes

    with closing(Processes(2, Limits(seconds=600.0), run_cell)) as engine:    # so many worker processes
        engine.submit(cell)
        ended = engine.wait(1.0)                                              # what ended within a second

| looking for | file |
|---|---|
| what an engine is, and what becomes of a cell | engine.py |
| processes of this machine, one pool a worker | processes.py |
| a Dask cluster, here or elsewhere | cluster.py |
| a process of its own for a cell on a Dask worker | child.py |
| how long and how much memory a cell may have; one thread of everything | limits.py |
"""
