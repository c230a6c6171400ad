"""The page of a report: its parts as text, and how they become one file that asks nobody for anything.

| looking for | file |
|---|---|
| all parts and the data as one document | webpage.py |
| the sections, empty | report.html |
| how everything looks; colours of methods and bodies come from `posefit.report.colours` | report.css |
| what every part uses: names, colours and marks of methods, the command that runs a row again | ledger.js |
| the first screen: who leads, the figure of all methods, three tracks | lead.js |
| tables that any column sorts: leaderboard, all runs, failures | tables.js |
| curves and joints, and the buttons that show and hide methods | charts.js |
| how sure methods say they are, and whether that is so | certainty.js |
| mean ranks with the critical difference, paired tests, what publications claim | ranks.js |
| who wins where, and what choosing is worth | selection.js |
| how far a sweep is that goes on | live.js |
| bodies in the gallery; cards and the window that plays a track | scene.js, gallery.js |
| one method against all others | author.js |
| the header, and the order in which everything is drawn | main.js |

The scripts run as one, in the order of `webpage.SCRIPTS`, after those that all pages share (`posefit.page`). The
constant `D` is the data that `posefit.report.content` describes.
"""
