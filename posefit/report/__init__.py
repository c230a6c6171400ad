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
| a table of runs, and what both kinds of runs have in common | kind.py |
| the rows of a ledger as that table | runs.py |
| what differs between tracks and single searches | tracks.py, searches.py |
| figures and the score: digits, averages, texts | columns.py |
| the methods compared on the runs that they share; the leaderboard | leaderboard.py |
| charts of the page and for papers, as numbers | charts.py |
| the sentences of the first screen | summary.py |
| the data of the page, by two lists of sections | content.py |
| the page: markup, style and scripts as one document | page/ |
| charts by matplotlib, and the folder of a paper's figures | figures.py |
| the command that runs one row again | repeat.py |

Statistics are in `posefit.statistics`.
"""
