"""The handbook's queries of a ledger by other tools, run as they are printed there."""

import re
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from posefit.sweep.schema import FILE, VIEWED
from tests.report.browser import ledger, result
from tests.report.searched import searched
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


def test_the_columns_of_the_view_have_types_and_so_have_their_values(
    folder: Path,
) -> None:
    searched(folder / "searches", {"cma": 3}, [(1, 9, 10_000)])
    # 10 is more than 9, which it is not as a text
    ledger(folder / "large", [result(replace(FIRST, seed=k), 9.0 + k) for k in (0, 1)])
    for name in ("results", "searches", "large"):
        with closing(sqlite3.connect(folder / name / FILE)) as database:
            declared = {
                row[1]: row[2] for row in database.execute("PRAGMA table_info(runs)")
            }
            assert {name: declared[name] for name in VIEWED} == {
                name: kind for name, (_, _, kind) in VIEWED.items()
            }
            for column, (_, _, kind) in VIEWED.items():
                found = database.execute(f"SELECT DISTINCT typeof({column}) FROM runs")
                assert {row[0].upper() for row in found} <= {kind, "NULL"}, column
    with closing(sqlite3.connect(folder / "large" / FILE)) as database:
        query = "SELECT max(error_degrees), max(cost) FROM runs"
        assert database.execute(query).fetchone() == (10.0, 10.0)


@pytest.fixture
def duckdb() -> Any:
    """Return DuckDB, where it and its extension for SQLite are installed."""
    module = pytest.importorskip("duckdb")
    try:
        module.sql("INSTALL sqlite; LOAD sqlite")
    except module.Error:
        pytest.skip("DuckDB's extension for SQLite cannot be loaded here")
    return module


def block(word: str) -> str:
    """Return the block of code in which a pattern is found."""
    (found,) = [
        code
        for code in re.findall(r"```(?:python|sh)\n(.*?)```", PAGE, re.DOTALL)
        if re.search(word, code)
    ]
    return str(found)


def test_sqlite3_says_which_method_has_the_lowest_error(folder: Path) -> None:
    assert answer_of("sqlite3 results.*error_degrees") == [
        ("sapso@pca", "", 2, 1.5),
        ("cma@pca", "", 2, 2.5),
    ]


def test_sqlite3_says_which_cells_failed(folder: Path) -> None:
    assert answer_of("sqlite3 results.*faults") == [(FIRST.method, '["it had to"]')]


def answer_of(word: str) -> list[Any]:
    """Return what SQLite answers to the command in which a pattern is found."""
    ((file, query),) = re.findall(r'^sqlite3 (\S+) "(.*)"\n$', block(word))
    with closing(sqlite3.connect(file)) as database:
        return database.execute(query).fetchall()


def test_pandas_says_which_settings_are_best(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pandas")
    exec(block("pandas as pd(.|\\n)*motion"), {})
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[-1] for line in lines if "{}" in line] == ["1.5", "2.5"]


def test_pandas_says_which_method_is_best_on_a_suite(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pandas")
    searched(tmp_path / "results", {"cma": 5, "pso": 1}, [(1, 9, 10_000)])
    monkeypatch.chdir(tmp_path)
    exec(block("pandas as pd(.|\\n)*function"), {})
    lines = capsys.readouterr().out.splitlines()
    # 5 + 2 and 1 + 2 targets reached; the kth costs 2 ** (5 - (k - 1) / 4)
    assert [float(line.split()[-1]) for line in lines if "{}" in line] == [
        pytest.approx(2.0**3.5, abs=1e-4),
        pytest.approx(2.0**4.5, abs=1e-4),
    ]


def test_polars_reads_the_view(folder: Path) -> None:
    polars = pytest.importorskip("polars")
    (call,) = re.findall(r"`(polars\.read_database\(.*?\))` reads", PAGE)
    assert len(eval(call, {"polars": polars, "sqlite3": sqlite3})) == 5


def test_duckdb_compares_methods_by_numbers(
    folder: Path, capsys: pytest.CaptureFixture[str], duckdb: Any
) -> None:
    exec(block("duckdb(.|\\n)*median"), {})
    shown = capsys.readouterr().out
    assert shown.index("sapso@pca") < shown.index("1.5") < shown.index("cma@pca")
