"""The handbook's own scripts in docs/ and docs/studies can be imported here."""

import sys

from tests.docs.pages import DOCS

sys.path[:0] = [str(DOCS), str(DOCS / "studies")]
