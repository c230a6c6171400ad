"""The page of a report: its parts as text, and how they become one file that asks nobody for anything.

| looking for | file |
|---|---|
| all parts and the data as one document | webpage.py |
| the sections, empty | report.html |
| how everything looks; colours of methods and bodies come from `posefit.report.colours` | report.css |
| what every part uses: elements, numbers in words, the command that runs a row again | base.js |
| tables that any column sorts: leaderboard, all runs, failures | tables.js |
| curves and joints, and the buttons that show and hide methods | charts.js |
| how sure methods say they are, and whether that is so | certainty.js |
| mean ranks with the critical difference, paired tests, the paper's claim | ranks.js |
| bodies on a canvas; cards and the window that plays a track | body.js, gallery.js |
| one method against all others | author.js |
| the header, and the order in which everything is drawn | main.js |

The scripts run as one, in the order of `webpage.SCRIPTS`, and share the constant `D`: the data that
`posefit.report.content` describes. Text reaches the page as text alone, never as markup, whatever names a ledger holds.
oxlint and oxfmt (`pip install 'posefit[dev]'`) check them as `.ci/run` does.
"""
