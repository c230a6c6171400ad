"""Pages in one file without network requests: what the report and a track's page share.

| looking for | file |
|---|---|
| markup, style, data and scripts as one document; JSON that is safe in it | document.py |
| the head of every page, and its look: colours for light and dark, type, buttons, tables | head.html, base.css |
| elements, and numbers in words | base.js |
| charts: axes, curves, bands, texts; drawings that follow the width of their box | chart.js |

A page's scripts run as one, these first, and share the constant `D`: its data. Text reaches a page as
text alone, never as markup. oxlint and oxfmt (`pip install 'posefit[dev]'`) check the scripts as `.ci/run` does.
"""
