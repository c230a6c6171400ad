"""What the first screen of a report says: who leads, how sure that is, what of it was claimed, and who wins where.

| looking for | file |
|---|---|
| the sentence about who leads; the three tracks of the leader that are shown beside it | lead.py |
| how many finished runs count in no comparison, as others failed | unpaired.py |
| how the orders came out that publications claim | claimed.py |
| the best method of each instance, the best of all, and a selector between them | selection.py |
"""
