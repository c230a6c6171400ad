"""What a ledger of single searches says, on one page: who reaches most targets, how soon, and how sure that is.

| looking for | file |
|---|---|
| the rows of a ledger as runs; methods and problems told apart | rows.py |
| the methods held against each other on the runs that they share | match.py |
| the sentence of the first screen | answer.py |
| everything the page shows, as data | content.py |
| what the command writes and prints | write.py |
| the page: its markup and scripts, beside those that it shares with reports of tracks | page/ |

A run's score is the share of its problem's targets that it reached, in per cent: `posefit.suites.problem.TARGETS`.
"""
