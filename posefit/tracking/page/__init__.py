"""The viewer of one track, `track.html`: one file that any browser opens from disk, and that asks nobody for anything.

| looking for | file |
|---|---|
| the document, and how it is written | webpage.py |
| small pictures of what was seen, as many as there is room for | album.py |
| everything the page shows, as data | content.py |
| colours, those of bodies on any page too | colours.py |
| the places of everything, empty; how it looks | viewer.html, viewer.css |
| what a camera saw with the body on it; the body in 3D | panels.js |
| curves with intervals, and rows of marks | curves.js |
| the player, the keys, and the words above and below | main.js |

The scripts run as one, after those that all pages share (`posefit.page`). The constant `D` is the data that content.py
describes.
"""
