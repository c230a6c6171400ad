"""A plugin package's docstring is its manual page, and the example on it runs."""

import ast
import doctest
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2] / "plugins"
PAGES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(
        ".__init__"
    ): ast.get_docstring(tree) or ""
    for path in sorted(ROOT.rglob("*.py"))
    if (tree := ast.parse(path.read_text("utf-8"))).body
}


@pytest.mark.parametrize(
    "name", [name for name, text in PAGES.items() if ">>> " in text]
)
def test_the_example_of_a_manual_page_runs(name: str) -> None:
    try:
        result = doctest.testmod(import_module(name))
    except ModuleNotFoundError as error:
        pytest.skip(f"without {error.name}")
    # Python counts skipped lines as attempted from 3.13 on
    assert PAGES[name].count(">>> ") >= 3
    assert result.failed == 0
