"""A ledger keeps every row, whatever becomes of the process that writes it; a strange file is one line."""

import json
import math
import os
import re
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.errors import InputError
from posefit.registry import registry
from posefit.sweep.command import swept
from posefit.sweep.drive import drive
from posefit.sweep.engine import Outcome
from posefit.sweep.ledger import Ledger
from posefit.sweep.schema import FILE, FORMAT, MIGRATIONS
from posefit.sweep.shard import cells_of
from posefit.sweep.versions import other_version
from posefit.sweep.writer import ATTEMPTS, LOSSES, Writer
from posefit.version import posefit_build
from tests.cases import each
from tests.report import browser
from tests.report.contests import runs_in
from tests.sweep import fake
from tests.sweep.fake import Instant, cells, filled, quarantined_in, result, rows_in

ROOT = Path(__file__).parents[2]
CONNECT = sqlite3.connect


def changed(folder: Path, query: str, *values: Any) -> None:
    """Do to a ledger what anybody can do with sqlite3."""
    with closing(sqlite3.connect(folder / FILE)) as database, database:
        database.execute(query, values)


def test_rows_come_back_as_they_were_written(tmp_path: Path) -> None:
    with Ledger(filled(tmp_path / "results")) as ledger:
        assert len(ledger) == 5
        for row, cell in zip(ledger.rows(), cells(5), strict=True):
            del row["seconds"]
            assert row.items() <= result(cell).items()


def test_a_frame_has_a_row_a_cell_in_the_order_of_the_specs(
    tmp_path: Path, monkeypatch: Any
) -> None:
    pytest.importorskip("pandas")
    folder = filled(tmp_path / "results", 3, start=2)
    filled(folder, 2)
    bad = cells(6)[5]
    with Writer(folder / FILE) as ledger:
        ledger.plan([bad])
        assert [ledger.fail(bad.key, "it had to") for _ in range(ATTEMPTS)] == [
            False,
            False,
            True,
        ]
    with Ledger(folder) as opened:
        table = opened.frame()
    assert table["seed"].tolist() == [0, 1, 2, 3, 4, 5]
    assert table["status"].tolist() == ["done"] * 5 + ["quarantined"]
    assert table["reason"].iloc[5] == "it had to; it had to; it had to"
    for name, value in (
        ("version", posefit_build()),
        ("view_degrees", "45"),
        ("evaluations", 2440),
        ("kind", "track"),
    ):
        assert table[name].unique().tolist() == [value]
    assert (
        table["error_degrees.mean"].iloc[0]
        == result(cells(1)[0])["error_degrees"]["mean"]
    )
    assert table["joint_errors_mm.rhand"].iloc[4] == 4.0
    assert np.isnan(table["cost"].iloc[5])
    monkeypatch.setitem(sys.modules, "pandas", None)
    with (
        Ledger(folder) as opened,
        pytest.raises(ImportError, match=r"pip install 'posefit\[sweep\]'"),
    ):
        opened.frame()


ROW = {
    name: value
    for name, value in browser.result(cells(1)[0], 1.0).items()
    if name not in ("key", "spec", "status")
}
SPEC = cells(1)[0].spec


@each(
    ("column", "change", "reason"),
    [
        ("row", {"iou": "low"}, "could not convert string to float"),
        ("row", {"iou": {"mean": 0.9}}, "TypeError"),
        ("row", {"iou": [0.9]}, "TypeError"),
        ("row", {"trace": {"evaluations": [1]}}, "KeyError"),
        ("row", {"trace": 2.0}, "TypeError"),
        ("row", {"error_degrees": "low"}, "TypeError"),
        ("row", {"warnings": 1}, "TypeError"),
        ("row", {"mode_reliability": [1]}, "TypeError"),
        ("spec", {"kind": "tracks"}, "KeyError: 'tracks'"),
        ("spec", {"more": 1}, "unexpected keyword argument 'more'"),
        ("spec", {"seed": [0]}, "TypeError"),
    ],
)
def test_a_row_that_posefit_did_not_write_is_named_with_advice(
    column, change, reason, tmp_path: Path
) -> None:
    folder = filled(tmp_path / "results", 2)
    key = cells(1)[0].key
    text = json.dumps({**(ROW if column == "row" else SPEC), **change})
    changed(folder, "UPDATE cells SET row = ? WHERE key = ?", json.dumps(ROW), key)
    changed(folder, f"UPDATE cells SET {column} = ? WHERE key = ?", text, key)
    with pytest.raises(ValueError, match=reason) as caught:
        runs_in(folder)
    assert f"results: the row of cell {key[:8]}" in str(caught.value)
    changed(folder, "DELETE FROM cells WHERE key = ?", key)
    filled(folder, 2)
    assert len(rows_in(folder)) == 2


def test_quarantined_cells_of_a_locked_ledger_are_reported_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = filled(tmp_path / "results", 1)
    monkeypatch.setattr("posefit.sweep.writer.BUSY_SECONDS", 0.01)
    with Writer(folder / FILE) as ledger, closing(CONNECT(folder / FILE)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(ValueError, match="got one in use"):
            ledger.release_quarantined()


def test_a_damaged_file_is_reported_in_one_line_with_sqlites_own_reason_and_what_to_do(
    tmp_path: Path,
) -> None:
    folder = filled(tmp_path / "results", 200)
    path = folder / FILE
    whole = path.read_bytes()
    for content, reason in (
        (b"no database, whatever its name says" * 100, "file is not a database"),
        (
            whole[:4096] + b"\0" * (len(whole) - 8192) + whole[-4096:],
            "malformed|btreeInitPage|never used|invalid page",
        ),
        (whole[: len(whole) // 2], "malformed|invalid page|not a database"),
    ):
        path.write_bytes(content)
        for read in (lambda: rows_in(folder), lambda: Writer(path)):
            with pytest.raises(
                ValueError, match="expected an intact SQLite file, got "
            ) as caught:
                read()
            assert str(path) in str(caught.value)
            assert "sqlite3 ledger.sqlite .recover" in str(caught.value)
            assert caught.match(reason)


def test_a_closed_ledger_says_so(tmp_path: Path) -> None:
    with Ledger(filled(tmp_path / "results")) as ledger:
        pass
    with pytest.raises(ValueError, match="expected an open ledger, got a closed one"):
        list(ledger.rows())


def test_a_ledgers_name_may_contain_pattern_characters(tmp_path: Path) -> None:
    folder = filled(tmp_path / "results", 2)
    for name in ("a[1].sqlite", "*.sqlite", "?.sqlite", "{a,b}.sqlite"):
        copy = tmp_path / name
        copy.write_bytes((folder / FILE).read_bytes())
        with Ledger(copy) as ledger:
            assert len(ledger) == 2
            assert ledger.changed == copy.stat().st_mtime


@each(
    ("name", "reason", "reads", "writes"),
    [
        ("", "database is locked", "one in use", "one in use"),
        ("", "locking protocol", "one on a disk that SQLite cannot share", "a local folder"),
        ("SQLITE_IOERR_SHMMAP", "disk I/O error", "one on a disk that SQLite cannot share", "a local folder"),
        ("SQLITE_IOERR_READ", "disk I/O error", "one that cannot be opened here", "got disk I/O error"),
        ("SQLITE_CANTOPEN", "unable to open database file", "one that cannot be opened here", "got unable"),
    ],
)  # fmt: skip
def test_only_damage_is_called_damage(
    name: str, reason: str, reads: str, writes: str, tmp_path: Path
) -> None:
    folder = filled(tmp_path / "results", 2)

    class Refused(sqlite3.Connection):
        """A connection to a file that SQLite cannot use here."""

        def execute(self, *_: Any) -> Any:
            error = sqlite3.OperationalError(reason)
            if name:
                error.sqlite_errorname = name
            raise error

    def connect(*args: Any, **more: Any) -> sqlite3.Connection:
        return CONNECT(*args, **more, factory=Refused)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sqlite3, "connect", connect)
        for opened, came in ((Ledger, reads), (Writer, writes)):
            with pytest.raises(InputError, match=re.escape(came)) as caught:
                opened(folder / FILE)
            assert reason in str(caught.value)
            assert "recover" not in str(caught.value)
    filled(folder, 3)


def test_a_ledger_that_another_program_locks_is_in_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("ledger", "writer"):
        monkeypatch.setattr(f"posefit.sweep.{module}.OPEN_SECONDS", 0.01)
    folder = filled(tmp_path / "results", 2)
    with closing(sqlite3.connect(folder / FILE, isolation_level=None)) as other:
        # so that readers have to wait, too
        other.execute("PRAGMA journal_mode = DELETE")
        other.execute("BEGIN EXCLUSIVE")
        for opened in (Ledger, Writer):
            with pytest.raises(
                ValueError, match=r"got one in use \(database is locked\)"
            ):
                opened(folder / FILE)
    filled(folder, 3)


@each("kind", ["link", "hard link", "file", "pipe", "folder"])
def test_a_lock_file_of_another_program_is_not_changed(
    kind: str, tmp_path: Path
) -> None:
    mine = tmp_path / "mine.txt"
    mine.write_text("mine")
    folder = tmp_path / "results"
    folder.mkdir()
    name = folder / f"{FILE}.driver"
    if kind == "link":
        name.symlink_to(mine)
    elif kind == "hard link":
        name.hardlink_to(mine)
    elif kind == "file":
        name.write_text("mine")
    elif kind == "pipe":
        os.mkfifo(name)
    else:
        name.mkdir()
    with pytest.raises(
        ValueError, match="driver: expected|expected a ledger that can be"
    ):
        Writer(folder / FILE)
    assert mine.read_text() == "mine"
    assert [path.name for path in folder.iterdir()] == [name.name]
    if kind == "file":
        assert name.read_text() == "mine"


def test_a_ledger_is_not_made_through_a_link_that_leads_nowhere(tmp_path: Path) -> None:
    folder = tmp_path / "results"
    folder.mkdir()
    (folder / FILE).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(ValueError, match="got a broken link"):
        Writer(folder / FILE)
    assert not (tmp_path / "elsewhere").exists()


def test_a_refused_track_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise sqlite3.OperationalError("locking protocol")

    monkeypatch.setattr(Writer, "_prepare", refuse)
    with pytest.raises(ValueError, match="locking protocol"):
        Writer(tmp_path / "o" / "p" / "q" / FILE)
    assert list(tmp_path.iterdir()) == []


def test_a_ledger_of_the_first_format_is_read_and_brought_to_todays(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "results"
    folder.mkdir()
    with closing(sqlite3.connect(folder / FILE)) as old:
        old.executescript(
            f"{MIGRATIONS[1]} CREATE VIEW runs AS SELECT key FROM cells; PRAGMA user_version = 1;"
        )
        old.execute(
            "INSERT INTO cells (key, kind, spec, status, row) VALUES (?, 'track', ?, 'done', ?)",
            [cells(1)[0].key, json.dumps(SPEC), json.dumps(ROW)],
        )
        old.commit()
    assert len(rows_in(folder)) == 1
    filled(folder, 2)
    assert len(rows_in(folder)) == 2
    with closing(sqlite3.connect(folder / FILE)) as database:
        assert database.execute("PRAGMA user_version").fetchone() == (FORMAT,)
        assert database.execute("SELECT sum(seed) FROM runs").fetchone() == (1,)


def test_a_file_that_is_not_a_ledger_is_named(tmp_path: Path) -> None:
    other, short, empty = (
        tmp_path / f"{name}.sqlite" for name in ("other", "short", "empty")
    )
    (mine := tmp_path / "mine.txt").write_text("mine")
    for opened, path, message in (
        (
            Ledger,
            tmp_path / "nowhere",
            r"expected a ledger, a folder or .sqlite file .*, got none",
        ),
        (Ledger, tmp_path, "got a folder without one"),
        (
            Writer,
            tmp_path / FILE,
            "expected a new folder or a ledger, got one with mine.txt",
        ),
        (Writer, mine / FILE, "expected a folder for the ledger, got a file"),
    ):
        with pytest.raises(ValueError, match=message):
            opened(path)
        assert list(tmp_path.iterdir()) == [mine]
    with closing(sqlite3.connect(other)) as database, database:
        database.execute("CREATE TABLE notes (text TEXT)")
    short.write_bytes(b"x")
    empty.touch()
    folder = filled(tmp_path / "later", 1)
    changed(folder, "PRAGMA user_version = 9")
    for path, message in (
        (other, "expected a ledger that posefit sweep wrote, got another SQLite file"),
        (
            short,
            "an intact SQLite file, got a file of 1 byte, too short to be one: use",
        ),
        (folder / FILE, "expected a ledger of format 1 to 3, got 9"),
    ):
        for opened in (Ledger, Writer):
            with pytest.raises(ValueError, match=message):
                opened(path)
    with pytest.raises(
        ValueError,
        match="expected a ledger that posefit sweep wrote, got an empty file",
    ):
        Ledger(empty)
    Writer(empty).close()  # as where a driver was killed at once


HOLD = """
import sys, time
from posefit.sweep.writer import Writer
with Writer(sys.argv[1]):
    print("open", flush=True)
    time.sleep(600)
"""


def test_a_driver_that_was_killed_holds_nothing(tmp_path: Path) -> None:
    path = tmp_path / "results" / FILE
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(path)], cwd=ROOT, stdout=subprocess.PIPE
    ) as held:
        assert held.stdout.readline() == b"open\n"
        with pytest.raises(
            ValueError,
            match=f"got one that process {held.pid} of .* writes to; use --shard I/N",
        ):
            Writer(path)
        held.send_signal(signal.SIGKILL)
        held.wait()
    Writer(path).close()


def test_a_full_disk_ends_the_sweep_in_one_line_and_finished_rows_are_safe(
    tmp_path: Path,
) -> None:
    folder = filled(tmp_path / "results", 3)
    with Writer(folder / FILE) as ledger:
        ledger.plan(cells(50))
        pages = ledger._db.execute("PRAGMA page_count").fetchone()[0]
        # SQLite's own "database or disk is full"
        ledger._db.execute(f"PRAGMA max_page_count = {pages + 2}")
        with pytest.raises(
            ValueError,
            match=r"got database or disk is full; (\d+) of 50 cells are done and safe",
        ) as caught:
            drive(ledger, Instant(), print)
    safe = re.search(r"(\d+) of 50", str(caught.value))
    assert 3 <= len(rows_in(folder)) == int(safe[1]) < 50
    filled(folder, 50)


class Leaves(Instant):
    """An engine with a window of two that is gone once it returned three outcomes."""

    def __init__(self) -> None:
        super().__init__()
        self.returned = 0

    def window(self) -> int:
        if self.returned == 3:
            raise InputError("the engine is gone")
        return 2

    def wait(self, seconds: float) -> list[Outcome]:
        self.returned += 1
        return [self.ended.pop(0)]


def test_cells_that_ended_when_the_engine_is_lost_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # nothing is written while cells run
    monkeypatch.setattr("posefit.sweep.drive.WRITE_SECONDS", math.inf)
    folder = tmp_path / "results"
    with Writer(folder / FILE) as ledger:
        ledger.plan(cells(8))
        with pytest.raises(
            InputError, match="the engine is gone; 3 of 8 cells are done and safe"
        ):
            drive(ledger, Leaves(), print)
    assert len(rows_in(folder)) == 3


class Counting(Writer):
    """Counts its writes."""

    writes = 0

    @contextmanager
    def transaction(self) -> Iterator[None]:
        self.writes += 1
        with super().transaction():
            yield


@pytest.mark.parametrize(("seconds", "writes"), [(math.inf, 1), (0.0, 8)])
def test_outcomes_that_come_together_are_written_together(
    seconds: float, writes: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("posefit.sweep.drive.WRITE_SECONDS", seconds)
    tallies: list[int] = []
    with Counting(tmp_path / "results" / FILE) as ledger:
        ledger.plan(cells(8))
        ledger.writes = 0
        drive(ledger, Instant(), print, lambda tally: tallies.append(tally.done))
    assert ledger.writes == writes
    assert tallies[-1] == len(rows_in(tmp_path / "results")) == 8


def test_only_a_cells_own_faults_count_towards_its_three_attempts_and_fifty_losses_are_too_many(
    tmp_path: Path,
) -> None:
    cell, lost = cells(2)
    with Writer(tmp_path / "results" / FILE) as ledger:
        ledger.plan([cell, lost])
        outcomes = [
            ledger.fail(cell.key, "its own", own)
            for own in (False, True, False, True, False, True)
        ]
        assert outcomes == [False] * 5 + [True]
        losses = [
            ledger.fail(lost.key, "killed", is_own_fault=False) for _ in range(LOSSES)
        ]
        assert losses == [False] * (LOSSES - 1) + [True]
        assert ledger.counts() == {"quarantined": 2}
        reasons = {
            row["key"]: row["reasons"] for row in quarantined_in(tmp_path / "results")
        }
        assert reasons == {
            cell.key: ["its own"] * 3,
            lost.key: ["killed from outside 50 times", "killed"],
        }
        assert ledger.release_quarantined() == 2
        assert len(ledger.planned()) == 2


def test_a_cell_that_ran_twice_is_written_once_and_a_failed_one_runs_last(
    tmp_path: Path,
) -> None:
    chosen = cells(3)
    with Writer(tmp_path / "results" / FILE) as ledger:
        ledger.plan(chosen)
        ledger.fail(chosen[0].key, "it had to")
        assert [ledger.cell(place) for place in ledger.planned()] == [
            chosen[1],
            chosen[2],
            chosen[0],
        ]
        other = {**result(chosen[1]), "cost": 9.0}
        assert [
            ledger.finish(chosen[1].key, done) for done in (result(chosen[1]), other)
        ] == [True, False]
    assert [row["cost"] for row in rows_in(tmp_path / "results")] == [
        result(chosen[1])["cost"]
    ]


def test_shards_are_one_ledger_and_a_row_in_several_files_counts_once(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "results"
    for k, count in enumerate((3, 5)):
        with Writer(folder / f"ledger-{k + 1}-of-2.sqlite") as ledger:
            ledger.plan(chosen := cells(6))
            for cell in chosen[:count]:
                ledger.finish(cell.key, result(cell))
            # the fourth is done in the second file, the last one in neither
            for cell in chosen[count::2]:
                for _ in range(ATTEMPTS):
                    ledger.fail(cell.key, "it had to")
    for paths in ([folder], [folder / "ledger-1-of-2.sqlite", folder]):
        with Ledger(*paths) as merged:
            seeds = sorted(row["spec"]["seed"] for row in merged.rows())
            assert len(merged) == 5
            failed = [row["key"] for row in merged.quarantined()]
        assert failed == [chosen[5].key]
        assert seeds == [0, 1, 2, 3, 4]


def test_a_plan_that_grows_and_a_run_without_shards_repeat_nothing(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "results"
    shards = [f"{k}/3" for k in (1, 2, 3)]
    ran = 0
    for count in (20, 30):
        parts = [list(cells_of(cells(count), shard)) for shard in shards]
        assert all(parts)
        together = sorted(cell.seed for part in parts for cell in part)
        assert together == list(range(count))
        for shard in shards:
            ran += swept(cells(count), folder, Instant(), print, shard=shard).ran
        assert ran == count
    # all in one, after a shard that was ended before it wrote anything
    (folder / "ledger-1-of-4.sqlite").touch()
    tally = swept(cells(32), folder, Instant(), print)
    assert (tally.cells, tally.done, tally.ran) == (32, 32, 2)
    assert swept(cells(32), folder, Instant(), print).ran == 0
    (folder / "ledger-1-of-4.sqlite").unlink()
    assert len(rows_in(folder)) == 32


def test_a_name_changes_no_key_and_the_latest_plans_name_counts(tmp_path: Path) -> None:
    folder = filled(tmp_path / "results", 1)
    cell = cells(1)[0]
    with Writer(folder / FILE) as ledger:
        ledger.plan([replace(cell, name="cold")])
        assert ledger.counts() == {"done": 1}
    assert [row["spec"]["name"] for row in rows_in(folder)] == ["cold"]


def test_rows_of_another_version_are_read_and_counted_and_their_cells_run_again(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "results"
    fake.swept(
        folder,
        [replace(cell, version="posefit 0.0.9 a1") for cell in cells(2)],
        Instant(),
    )
    with Ledger(folder) as ledger:
        assert ledger.version == "0.0.9 a1"
    messages: list[str] = []
    assert swept(cells(3), folder, Instant(), messages.append).ran == 3
    assert messages == [
        f"{folder}: 2 rows of another version do not count: posefit 0.0.9 a1"
    ]
    with Ledger(folder) as ledger:
        assert len(ledger) == 5
        assert ledger.version == f"0.0.9 a1, {posefit_build().removeprefix('posefit ')}"


def test_versions_differ_if_any_part_differs_from_the_installed_one() -> None:
    swarm = registry().offer("optimiser", "sapso").origin
    versions = [
        f"{posefit_build()}, {swarm}",
        f"{posefit_build()}, posefit_swarm 0ld",
        f"posefit 0.0.9 a1, {swarm}",
    ]
    # a plugin that is not installed here
    versions += [f"{posefit_build()}, posefit_elsewhere 1.0"]
    assert [v for v in versions if any(map(other_version, v.split(", ")))] == versions[
        1:3
    ]


def test_a_ledger_is_read_while_its_driver_writes(tmp_path: Path) -> None:
    path = tmp_path / "results" / FILE
    chosen = cells(4)
    with Writer(path) as ledger:
        ledger.plan(chosen)
        ledger.finish(chosen[0].key, result(chosen[0]))
        with Ledger(path) as early:
            ledger.finish(chosen[1].key, result(chosen[1]))
            with Ledger(path) as late:
                assert [len(list(one.rows())) for one in (early, late)] == [1, 2]
            assert early.changed <= time.time() + 1.0
