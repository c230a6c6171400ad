"""Pages in one file without network requests: what the report and a track's page share.

| looking for | file |
|---|---|
| markup, style, data and scripts as one document; JSON that is safe in it | document.py |
| cameras and joints as a page's scripts read them | bodies.py |
| the head of every page, and its look: colours for light and dark, type, buttons, tables | head.html, base.css |
| elements, and numbers in words | base.js |
| charts: axes, curves, bands, texts; drawings that follow the width of their box | chart.js |
| bodies of tapered cones on a canvas, seen by any camera; a view that can be turned | body.js |
| a clock that plays frames; mouse, touch and keys that turn a view | play.js |

A page's scripts run as one, these first, and share the constant `D`: its data, of which `D.joints`, `D.parents` and
`D.sides` are the skeleton's. Text reaches a page as text alone, never as markup. oxlint and oxfmt
(`pip install 'posefit[dev]'`) check the scripts as `.ci/run` does.
"""
