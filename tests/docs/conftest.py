"""The handbook's own scripts, docs/house.py and docs/generator, can be imported here."""

import sys

from tests.docs.pages import DOCS

sys.path.insert(0, str(DOCS))
