"""Where cells run: engines, which keep no order and no state; the ledger does.

    from contextlib import closing
    from posefit.sweep.cell import run_cell
    from posefit.sweep.engines.engine import Limits
    from posefit.sweep.engines.processes import Processes

    with closing(Processes(2, Limits(seconds=600.0), run_cell)) as engine:    # so many worker processes
        engine.submit(cell)
        ended = engine.wait(1.0)                                              # what ended within a second

| looking for | file |
|---|---|
| what an engine is, the limits of a cell, and why one failed | engine.py |
| processes of this machine | processes.py |
| a Dask cluster, here or elsewhere | cluster.py |
| the process that a cell runs in, of this machine or of a Dask worker | child.py |
"""
