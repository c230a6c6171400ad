"""What runs the cells of a sweep, or other jobs, somewhere else.

    engine.py     what an engine is, and what became of a job
    processes.py  processes of this machine
    cluster.py    a Dask cluster
    limits.py     how long a job may take, how much memory it may have, and one thread of everything
"""
