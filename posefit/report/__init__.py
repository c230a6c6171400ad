r"""The report of a ledger: a page for any browser, figures for papers, and tables.

    from posefit.report.leaderboard import standings_of
    from posefit.report.reading import runs_of
    from posefit.report.write import write_report
    from posefit.sweep.ledger import Ledger

    report = write_report("results", "report.html")  # what `posefit report` does
    print("\n".join(report.lines))
    with Ledger("results") as ledger:  # the same numbers, without the page
        best = standings_of(runs_of(ledger)).board[0]

| looking for | file |
|---|---|
| the steps of the command, and its checks | write.py |
| the runs of a ledger, their kind, and those that methods share | contest.py |
| reading the rows of a ledger | reading.py |
| what a row has besides figures, for a million rows | stored.py |
| distinct names of methods and instances | names.py |
| what differs between tracks and single searches | tracks.py, searches.py |
| figures and the score: names, digits, averages, texts | columns.py |
| the rows of the leaderboard and their order | leaderboard.py |
| the leaderboard as printed lines, CSV and LaTeX | table.py |
| charts of the page and for papers, as numbers | charts.py |
| the sentences of the first screen | summary.py |
| the data of the page | content.py |
| the page: markup, style and scripts as one document | page/ |
| charts by matplotlib, and the folder of a paper's figures | figures.py |
| single searches as files of COCO | coco.py |

Statistics are in `posefit.statistics`.
"""
