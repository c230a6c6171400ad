"""A report while the sweep goes on: a server of this machine alone, whose page says how far the sweep is.

| looking for | file |
|---|---|
| how many cells are done, run, failed and left, and about how long they take | progress.py |
| the page that shows it with the report so far; the server | server.py |
"""
