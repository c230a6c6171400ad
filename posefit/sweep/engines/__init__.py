"""What runs the cells of a sweep, or other jobs, somewhere else.

`engine` says what an engine is and what becomes of a job; `processes` runs jobs in processes of this machine, `cluster`
cells on a Dask cluster; `limits` says how long a job may take and how much memory it may have, and gives it one thread
of everything.
"""
