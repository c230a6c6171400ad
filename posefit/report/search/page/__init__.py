"""The page of a report of single searches: what is its own, beside the parts of `posefit.report.page`.

| looking for | file |
|---|---|
| all parts and the data as one document | webpage.py |
| the sections, empty | search.html |
| the leaderboard, and running times by function and dimension | times.js |
| curves of targets reached, of all functions and of each | reached.js |
| the header, and the order in which everything is drawn | main.js |

The constant `D` is the data that `posefit.report.search.content` describes.
"""
