"""The page of a report: its parts as text, and how they become one file that asks nobody for anything.

| looking for | file |
|---|---|
| all parts and the data as one document | webpage.py |
| the sections, empty | report.html |
| how everything looks; colours of methods and bodies come from `posefit.report.colours` | report.css |
| what every part uses: names, colours and marks of methods, what they are judged by | ledger.js |
| a table that any column sorts | table.js |
| what failed, on top and as a table; the command that runs a cell again | failures.js |
| a chart over evaluations, and the buttons that show and hide methods | chart.js |
| the figure of all methods with their intervals and the baselines | standing.js |
| how far a sweep is that goes on | live.js |
| the first screen of a sweep of tracks: who leads, three tracks | lead.js |
| the leaderboard, and all runs | tables.js |
| curves and joints | charts.js |
| how sure methods say they are, and whether that is so | certainty.js |
| mean ranks with the critical difference, paired tests, what publications claim | ranks.js |
| who wins where, and what choosing is worth | selection.js |
| bodies in the gallery; cards and the window that plays a track | scene.js, gallery.js |
| one method against all others | author.js |
| the header, and the order in which everything is drawn | main.js |

The scripts run as one, in the order of `webpage.COMMON` and `webpage.SCRIPTS`, after those that all pages share
(`posefit.page`). The first six, and the style, are those of `posefit.report.search.page`, too. The
constant `D` is the data that `posefit.report.content` describes.
"""
