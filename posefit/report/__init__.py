r"""What a ledger says: one page that any browser opens, figures and tables for papers, files for other tools.

    from posefit.report.write import leaderboard_lines, write_report

    found = write_report("results", "report.html", say=print)       # what `posefit report` does
    print("\n".join(leaderboard_lines(found)))

    from posefit.report.contest import contest_of, leaderboard       # the same numbers, without the page
    from posefit.report.runs import runs_of
    from posefit.sweep.ledger import Ledger

    contest = contest_of(runs_of(Ledger("results")))
    best = leaderboard(contest)[0]

| looking for | file |
|---|---|
| the order of what the command does, and what it refuses | write.py |
| the rows of a ledger as arrays; methods, instances and seeds told apart | runs.py |
| which figures of a row are shown, under which label, with which digits | columns.py |
| the methods held against each other on the runs that they share | contest.py |
| cost over evaluations, targets reached, errors of joints, how sure methods are, as numbers | curves.py |
| everything the page shows, as data; its moving pictures | content.py, gallery.py |
| what the first screen says: who leads, what was claimed of it, who wins where | answer/ |
| the report of a ledger of single searches | search/ |
| the report of a sweep that goes on, shown to this machine alone | live/ |
| the page: its markup, style and scripts, and how they become one file | page/ |
| figures by matplotlib; colours; all of a paper's files in one folder | figures.py, colours.py, portfolio.py |
| LaTeX; CSV and IOHprofiler's files | latex.py, export.py |
| the command that runs one row again | repeat.py |

What is computed is in `posefit.statistics`: interquartile means with studentised bootstrap intervals, Friedman's test
with Nemenyi's critical difference, Wilcoxon's signed ranks after Holm, probabilities of improvement.
"""
