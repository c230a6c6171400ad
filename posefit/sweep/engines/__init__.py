"""Where cells run: engines (engine.py), which keep no order and no state; the ledger does.

    with closing(Processes(2, Limits(seconds=600.0), run_cell)) as engine:    # so many worker processes: processes.py
        engine.submit(cell)
        ended = engine.wait(1.0)                                              # what ended within a second

A Dask cluster, here or elsewhere, is one too: cluster.py.
"""
