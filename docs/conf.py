"""How the handbook is built: `sphinx-build -W -b html docs docs/_build`."""

import os
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS))

import generator  # noqa: E402, what stands beside this file
from generator.prose import restructured, shortened  # noqa: E402

import posefit  # noqa: E402

project = "posefit"
author = "The posefit developers"
project_copyright = "The posefit developers"
release = version = posefit.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx_copybutton"]
# the last are parts of pages
exclude_patterns = ["_build", "contributions"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
# thousands, and every page would look through them for its navigation
toc_object_entries = False
# what `Problem.ioh` builds upon
autodoc_mock_imports = ["ioh"]
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 90
copybutton_exclude = ".linenos, .gp, .go"

html_theme = "furo"
# where the site is published, for search engines
html_baseurl = os.environ.get("HANDBOOK_URL", "")
html_title = "posefit"
html_static_path = ["static"]
html_css_files = ["handbook.css"]
html_theme_options = {"navigation_with_keys": True}


def setup(app: Any) -> None:
    """Write the generated pages, and have docstrings read as plain text."""
    generator.write()
    app.connect("autodoc-process-docstring", _restructure)
    app.connect("autodoc-process-signature", _shorten)


def _restructure(
    _app: Any, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]
) -> None:
    lines[:] = restructured(lines)


def _shorten(
    _app: Any, _what: str, _name: str, _object: Any, _options: Any, *texts: str | None
) -> tuple[str | None, ...]:
    """Return a signature and its result with arrays named as in the code."""
    return tuple(None if text is None else shortened(text) for text in texts)
