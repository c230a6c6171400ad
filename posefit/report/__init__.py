r"""The report of a ledger: a page for any browser, figures for papers, and tables.

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
| the steps of the command, and its checks | write.py |
| the table of runs, and the contest of the methods that share some | contest.py |
| reading the rows of a ledger into that table | runs.py |
| what a row has besides figures, for a million rows | stored.py |
| tracks, with the error with losses | tracks.py |
| single searches | searches.py |
| figures and the score: names, digits, averages, texts | columns.py |
| the comparison on shared runs; the leaderboard and its order | leaderboard.py |
| the leaderboard as printed lines, CSV and LaTeX | table.py |
| charts of the page and for papers, as numbers | charts.py |
| the sentences of the first screen | summary.py |
| the data of the page | content.py |
| the page: markup, style and scripts as one document | page/ |
| charts by matplotlib, and the folder of a paper's figures | figures.py |
| single searches as files of COCO | coco.py |
| running a row again, with or without a ledger | repeat.py |

Statistics are in `posefit.statistics`.
"""
