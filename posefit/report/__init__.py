r"""The report of a ledger: a page that any browser opens, figures for papers, rows for other tools.

    from posefit.report.leaderboard import contest_of, leaderboard
    from posefit.report.runs import runs_of
    from posefit.report.write import leaderboard_lines, write_report
    from posefit.sweep.ledger import Ledger

    report = write_report("results", "report.html")  # what `posefit report` does
    print("\n".join(leaderboard_lines(report)))
    with Ledger("results") as ledger:  # the same numbers, without the page
        best = leaderboard(contest_of(runs_of(ledger)))[0]

| looking for | file |
|---|---|
| what the command does, in order, and what it refuses | write.py |
| a table of runs, and what a kind of runs has to say of them | kind.py |
| the rows of a ledger as that table | runs.py |
| the two kinds: tracks, with the error with losses, and single searches | tracks.py, searches.py |
| figures and the score: names, digits, averages, texts | columns.py |
| the methods compared on the runs that they share; the leaderboard and its order | leaderboard.py |
| the leaderboard as printed lines, CSV and LaTeX | table.py |
| charts of the page and for papers, as numbers | charts.py |
| the sentences of the first screen | summary.py |
| the data of the page | content.py |
| the page: markup, style and scripts as one document | page/ |
| charts by matplotlib, and the folder of a paper's figures | figures.py |
| one row run again: `posefit rerun`, or a command that needs no ledger | repeat.py |

Statistics are in `posefit.statistics`.
"""
