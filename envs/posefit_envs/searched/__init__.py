"""Environments as something to search: proposals in, costs out.

| looking for | file |
|---|---|
| one environment or many that cost proposals, whatever the size of a population and the end of an episode | desk.py |
| a search that takes a proposal at a time | stepwise.py |
"""
