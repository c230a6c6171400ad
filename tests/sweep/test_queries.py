"""The handbook's queries of a ledger by other tools, run as they are printed there."""

import re
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from tests.report.browser import ledger, result
from tests.sweep.fake import cells

PAGE = (Path(__file__).parents[2] / "docs" / "howto" / "report.md").read_text(
    encoding="utf-8"
)
FIRST = cells(1)[0]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with results, in which a reader of the page stands."""
    made = [
        result(replace(FIRST, method=method, seed=seed), error + seed)
        for method, error in (("sapso@pca", 1.0), ("cma@pca", 2.0))
        for seed in range(2)
    ]
    ledger(tmp_path / "results", made, [(replace(FIRST, seed=9), ["it had to"])])
    monkeypatch.chdir(tmp_path)
    return tmp_path


def block(word: str) -> str:
    """Return the block of code that has a word."""
    (found,) = [
        code
        for code in re.findall(r"```(?:python|sh)\n(.*?)```", PAGE, re.DOTALL)
        if word in code
    ]
    return str(found)


def test_sqlite3_says_which_method_has_the_lowest_error(folder: Path) -> None:
    ((file, query),) = re.findall(r'^sqlite3 (\S+) "(.*)"\n$', block("sqlite3 results"))
    with closing(sqlite3.connect(file)) as database:
        assert database.execute(query).fetchall() == [
            ("sapso@pca", "", 2, 1.5),
            ("cma@pca", "", 2, 2.5),
        ]


def test_pandas_says_which_settings_are_best(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pandas")
    exec(block("pandas"), {})
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[-1] for line in lines if "{}" in line] == ["1.5", "2.5"]


def test_duckdb_says_which_cells_failed(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    duckdb = pytest.importorskip("duckdb")
    try:
        duckdb.sql("INSTALL sqlite; LOAD sqlite")
    except duckdb.Error:
        pytest.skip("DuckDB's extension for SQLite cannot be loaded here")
    exec(block("duckdb"), {})
    assert "it had to" in capsys.readouterr().out
