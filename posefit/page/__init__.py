"""Pages in one file without network requests: the parts that all pages share.

| looking for | file |
|---|---|
| one document of markup, style, data and scripts; JSON for it | document.py |
| head of every page; colours, type, buttons, tables | head.html, base.css |
| elements, and numbers as text | base.js |
| charts: axes, curves, bands, texts; drawings as wide as their box | chart.js |

A page's scripts run as one script, these first, and share the page's data, the constant
`D`. Text is inserted only as text, never as markup. oxlint and oxfmt (`pip install
'posefit[dev]'`) check the scripts as `.ci/run` does.
"""
