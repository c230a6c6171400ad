"""A ledger keeps every row, whatever becomes of its files and of those who write to it."""

import errno
import os
import subprocess
import sys
import zlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.report.runs import runs_of
from posefit.sweep import log
from posefit.sweep.command import swept
from posefit.sweep.driver import ATTEMPTS, LOSSES, Driver, Lease, State, drive_cells
from posefit.sweep.ledger import Ledger
from posefit.version import posefit_build
from tests.cases import each
from tests.sweep.fake import Instant, cells, failed, filled, finished, leased, result


def the_log(folder: Path) -> Path:
    (path,) = (folder / "rows").glob("*.jsonl")
    return path


def test_rows_and_joints_come_back_as_they_were_written(tmp_path: Path) -> None:
    ledger = Ledger(filled(tmp_path / "ledger"))
    assert len(ledger) == 5
    for cell in cells(5):
        row, joints = ledger.row(cell.key), ledger.joints(cell.key)
        del row["joints"], row["seconds"]
        assert row.items() <= result(cell).row.items()
        assert joints["estimate"].dtype == np.float32
        np.testing.assert_array_equal(joints["truth"], np.full((1, 27, 3), cell.seed))


def test_a_frame_has_a_row_a_cell_in_the_order_of_the_specs(tmp_path: Path, monkeypatch: Any) -> None:
    pytest.importorskip("pandas")
    folder = filled(tmp_path / "ledger", 3, start=2)
    filled(folder, 2)
    bad = cells(6)[5]
    with Driver(folder) as driver:
        failed(driver, bad, *["it had to"] * ATTEMPTS)
        assert driver.lease(bad) is State.QUARANTINED
    table = Ledger(folder).frame()
    assert table["seed"].tolist() == [0, 1, 2, 3, 4, 5]
    assert table["status"].tolist() == ["done"] * 5 + ["quarantined"]
    assert table["reason"].iloc[5] == "it had to; it had to; it had to"
    for name, value in (("version", posefit_build()), ("view_degrees", "45"), ("evaluations", 2440)):
        assert table[name].unique().tolist() == [value]
    assert table["error_degrees.mean"].iloc[0] == result(cells(1)[0]).row["error_degrees"]["mean"]
    assert table["joint_errors_mm.rhand"].iloc[4] == 4.0
    assert np.isnan(table["cost"].iloc[5])
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ImportError, match=r"pip install 'posefit\[sweep\]'"):
        Ledger(folder).frame()


@each(
    "harm",
    [
        lambda line: line.replace(b'"cost": 0', b'"cost": 1'),
        lambda line: line[:200] + b"\n",
        lambda line: b"\x00" * (len(line) - 1) + b"\n",
        lambda line: b"\n",
    ],
)
def test_a_damaged_row_is_named_put_aside_and_run_again(harm: Any, tmp_path: Path) -> None:
    folder = filled(tmp_path / "ledger")
    lines = the_log(folder).read_bytes().splitlines(keepends=True)
    key = log.decoded(lines[2])[0]  # type: ignore[index]
    lines[2] = harm(lines[2])
    the_log(folder).write_bytes(b"".join(lines))

    messages: list[str] = []
    ledger = Ledger(folder, messages.append)
    assert len(ledger) == len(list(ledger.rows())) == 4
    assert key not in ledger
    assert len(messages) == 1
    assert str(the_log(folder)) in messages[0]
    assert "put aside" in messages[0]
    if b"key" in lines[2]:
        assert f"the row of cell {key[:8]}" in messages[0]
    (aside,) = (folder / "aside").iterdir()
    assert aside.read_bytes() == lines[2]

    with Driver(folder, messages.append) as driver:
        assert drive_cells(cells(5), driver, Instant(), print).ran == 1
    assert len(messages) == 1
    assert sorted(row["key"] for row in Ledger(folder).rows()) == sorted(cell.key for cell in cells(5))


SPEC = result(cells(1)[0]).row["spec"]


@each(
    ("change", "reason"),
    [
        ({"cost": "low"}, "cost must be a number, got 'low'"),
        ({"cost": 10**400}, "cost must be a number"),
        ({"cost": [1.0]}, "cost must be a number"),
        ({"error_degrees": 1.0}, "error_degrees must be figures by their names, got 1.0"),
        ({"error_degrees": {"mean": "x"}}, "mean must be a number, got 'x'"),
        ({"spec": {}}, "spec must be the fields of a cell, got none called 'body_off_percent'"),
        ({"spec": {**SPEC, "seed": "0\nEND\nrm -r x"}}, "seed must be a whole number"),
        ({"spec": {**SPEC, "frames": 10**7}}, "frames must lie in 1 to 100000"),
        ({"spec": {**SPEC, "settings": {"a": {}}}}, "settings a must be a value"),
        ({"trace": {"evaluations": [1, 1], "cost": [2, 1]}}, "trace must be rising evaluations"),
        ({"trace": {"evaluations": [1], "cost": []}}, "trace must be rising evaluations"),
        ({"joint_errors_mm": [0.0] * 26}, "joint_errors_mm must be 27 numbers"),
        ({"warnings": "none"}, "warnings must be a list of texts"),
        ({"mode_reliability": [[1, -1.0, 0.5]]}, "mode_reliability must be triples"),
        ({"key": "0" * 64}, "expected the row of cell"),
        ({"status": "lost"}, "status must be one of done"),
        ({"warnings": ["\ud800"]}, "a row must hold whole characters"),
    ],
)
def test_a_row_with_a_right_checksum_that_is_none_is_named_counted_and_run_again(
    change: dict[str, Any], reason: str, tmp_path: Path
) -> None:
    folder, cell = filled(tmp_path / "ledger", 2), cells(1)[0]
    rows = the_log(folder).read_bytes().splitlines(keepends=True)
    rows[0] = log.encoded(cell.key, {**result(cell).row, "joints": [0, 0, 0], **change})
    the_log(folder).write_bytes(b"".join(rows))
    messages: list[str] = []
    runs = runs_of(Ledger(folder, messages.append))
    assert len(runs) == len(runs.failures) == len(messages) == 1
    assert runs.failures[0]["name"] == f"rows/{the_log(folder).name} line 1"
    assert reason in messages[0]
    assert str(the_log(folder)) in messages[0]
    with Driver(folder, messages.append) as driver:
        assert drive_cells(cells(2), driver, Instant(), print).ran == 1
    again = runs_of(Ledger(folder, messages.append))
    assert (len(again), len(again.failures)) == (2, 0)


def test_of_two_rows_of_one_cell_the_first_counts(tmp_path: Path) -> None:
    cell, other = cells(2)
    folder = filled(tmp_path / "ledger", 1)
    path = the_log(folder)

    def line(cost: float) -> bytes:
        return log.encoded(cell.key, {**result(cell).row, "cost": cost, "joints": [0, 0, 0]})

    path.write_bytes(line(1.0) + line(2.0))
    (path.parent / "later.jsonl").write_bytes(line(3.0))
    assert path.name < "later.jsonl"
    assert Ledger(folder).row(cell.key)["cost"] == 1.0
    assert [row["cost"] for row in Ledger(folder).rows()] == [1.0]
    # the order in which logs are read makes no difference
    path.rename(tmp_path / path.name)
    growing = Ledger(folder)
    assert growing.row(cell.key)["cost"] == 3.0
    (tmp_path / path.name).rename(path)
    growing.refresh()
    assert growing.row(cell.key)["cost"] == 1.0
    assert other.key not in growing


def test_a_checksum_is_of_the_key_and_the_row() -> None:
    key = "0123456789abcdef" * 4
    line = log.encoded(key, {"cost": 1.0})
    crc = zlib.crc32(key.encode() + b'{"cost": 1.0}')  # CRC-32 as zip and PNG have it
    assert line == b'{"key": "%s", "crc": "%08x", "row": {"cost": 1.0}}\n' % (key.encode(), crc)
    assert log.decoded(line) == (key, b'{"cost": 1.0}')
    assert log.decoded(line.replace(b"0123", b"0133", 1)) is None  # one digit of the key
    assert log.decoded(line.replace(b"1.0", b"1.1")) is None


def test_a_row_that_was_cut_off_when_its_driver_died_is_no_row(tmp_path: Path) -> None:
    folder = filled(tmp_path / "ledger")
    whole = the_log(folder).read_bytes()
    for cut in (1, 100):
        the_log(folder).write_bytes(whole[:-cut])
        assert len(Ledger(folder, pytest.fail)) == 4
    filled(folder)


def test_damaged_joints_are_named(tmp_path: Path) -> None:
    folder = filled(tmp_path / "ledger", 1)
    path = the_log(folder).with_suffix(".joints")
    path.write_bytes(b"x" + path.read_bytes()[1:])
    with pytest.raises(ValueError, match=r"\.joints: the joints of cell .* must be whole, got damaged ones"):
        Ledger(folder).joints(cells(1)[0].key)


def test_rows_of_another_version_are_read_and_counted_and_their_cells_are_run_again(tmp_path: Path) -> None:
    folder, old = tmp_path / "ledger", [replace(cell, version="posefit 0.0.9 a1") for cell in cells(2)]
    with Driver(folder) as driver:
        drive_cells(old, driver, Instant(), print)
        assert driver.ledger.version == "0.0.9 a1"
        assert driver.ledger.outdated() == {"posefit 0.0.9 a1": 2}
        assert drive_cells(cells(3), driver, Instant(), print).ran == 3
    messages: list[str] = []
    assert swept(cells(4), folder, Instant(), messages.append).ran == 1
    assert messages[0].startswith(
        f"2 of the 5 rows in {folder} are of another version, posefit 0.0.9 a1, and do not count"
    )
    ledger = Ledger(folder)
    assert (len(ledger), ledger.outdated().total()) == (6, 2)
    assert ledger.version == f"0.0.9 a1, {posefit_build().removeprefix('posefit ')}"


def test_rows_of_another_version_are_kept_where_that_is_asked(tmp_path: Path) -> None:
    folder = tmp_path / "ledger"
    with Driver(folder) as driver:
        drive_cells([replace(cell, version="posefit 0.0.9 a1") for cell in cells(2)], driver, Instant(), print)
    messages: list[str] = []
    assert swept(cells(3), folder, Instant(), messages.append, keep_old=True).ran == 1
    assert "2 of the 2 rows" in messages[0]
    assert messages[0].endswith("and are kept")
    assert swept(cells(3), folder, Instant(), messages.append).ran == 2


@each(
    ("content", "message"),
    [
        ("{", "expected the index of a ledger, got"),
        ("[]", "expected the index of a ledger, got"),
        ("{}", "expected the index of a ledger, got 'format'"),
        ('{"format": 9, "version": "9"}', "expected a ledger of format 1, got 9"),
    ],
)
def test_an_index_that_is_none_is_named(content: str, message: str, tmp_path: Path) -> None:
    folder = filled(tmp_path / "ledger", 1)
    (folder / "ledger.json").write_text(content)
    for opened in (Ledger, Driver):
        with pytest.raises(ValueError, match=message):
            opened(folder)


def test_what_is_no_ledger_is_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected a ledger, a folder that posefit sweep wrote, got none"):
        Ledger(tmp_path / "nowhere")
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(ValueError, match="expected a new folder or a ledger, got one with mine.txt"):
        Driver(tmp_path)
    with pytest.raises(ValueError, match="expected a folder for the ledger, got a file"):
        Driver(tmp_path / "mine.txt")
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_folder_that_cannot_be_written_to_is_named(tmp_path: Path, monkeypatch: Any) -> None:
    folder = filled(tmp_path / "ledger")
    opened = os.open

    def refuse(path: Any, flags: int, *more: Any, **named: Any) -> int:
        if flags & os.O_CREAT:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))
        return opened(path, flags, *more, **named)

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(ValueError, match="ledger: expected a folder that can be written to, got Read-only file system"):
        Driver(folder).__enter__()
    assert len(list(Ledger(folder).rows())) == 5
    monkeypatch.setattr(Path, "mkdir", lambda self, *_, **__: refuse(self, os.O_CREAT))
    with pytest.raises(ValueError, match="new: expected a folder that can be written to, got Read-only file system"):
        Driver(tmp_path / "new")


@each("room", [3, 1500])
def test_a_full_disk_ends_the_sweep_in_one_line_and_finished_rows_are_safe(
    room: int, tmp_path: Path, monkeypatch: Any
) -> None:
    folder = filled(tmp_path / "ledger", 3)
    left, write = [room], os.pwrite

    def fill(file: int, data: bytes, offset: int) -> int:
        if not left[0]:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        done = write(file, data[: left[0]], offset)
        left[0] -= done
        return done

    monkeypatch.setattr(os, "pwrite", fill)
    with (
        Driver(folder) as driver,
        pytest.raises(
            ValueError, match=r"expected room to write to, got No space left on device; \d of 9 cells are done"
        ),
    ):
        drive_cells(cells(9), driver, Instant(), print)
    monkeypatch.undo()
    messages: list[str] = []
    assert 3 <= len(Ledger(folder, messages.append)) < 9
    assert not messages
    assert not list((folder / "leases").iterdir())
    filled(folder, 9)


def test_a_lease_holds_as_long_as_its_driver_lives(tmp_path: Path) -> None:
    cell, second = cells(2)
    with Driver(tmp_path / "ledger") as one, Driver(tmp_path / "ledger") as other:
        lease = leased(one, cell)
        assert lease == Lease(cell, 1)
        assert other.lease(cell) is one.lease(cell) is State.ELSEWHERE
        one.release(lease)
        finished(other, cell)
        assert one.lease(cell) is State.DONE
    with Driver(tmp_path / "ledger") as dead:
        assert dead.lease(second) == Lease(second, 1)
    with Driver(tmp_path / "ledger") as last:
        assert last.lease(second) == Lease(second, 2)


def test_the_death_of_drivers_is_no_fault_of_a_cell_until_fifty_of_them_got_nothing_else_done(tmp_path: Path) -> None:
    folder, (cell, other) = tmp_path / "ledger", cells(2)

    def die() -> int:
        with Driver(folder) as dead:
            lease = leased(dead, cell)
        return lease.attempt

    assert [die() for _ in range(LOSSES - 1)] == list(range(1, LOSSES))
    filled(folder, 1, start=1)  # another cell gets done, and all that was before counts no more
    assert [die() for _ in range(LOSSES)][-1] == 2 * LOSSES - 1
    with Driver(folder) as last:
        assert last.lease(cell) is State.QUARANTINED
    (lost,) = Ledger(folder).quarantined()
    assert lost["reasons"][0] == "something outside ended it 50 times while no other cell got done"
    assert all("its driver, process" in reason and reason.endswith("died") for reason in lost["reasons"][1:])
    assert not list((folder / "leases").iterdir())
    assert other.key in Ledger(folder)


def test_only_a_cells_own_faults_count_towards_its_three_attempts(tmp_path: Path) -> None:
    folder, (cell,) = tmp_path / "ledger", cells(1)
    with Driver(folder) as driver:
        for own in (False, True, False, False, True, False, True):
            driver.fail(leased(driver, cell), "its own" if own else "from outside", own)
        assert driver.lease(cell) is State.QUARANTINED
    assert Ledger(folder).quarantined()[0]["reasons"] == ["its own"] * ATTEMPTS


def test_a_lease_that_is_damaged_or_removed_costs_no_row_and_stops_nobody(tmp_path: Path) -> None:
    folder, (cell, other) = tmp_path / "ledger", cells(2)
    with Driver(folder) as one, Driver(folder) as two:
        first = leased(one, cell)
        (folder / "leases" / f"{cell.key}.1").unlink()
        second = leased(two, cell)
        one.fail(first, "too late")  # the lease is another one's by now
        one.release(first)
        assert two.lease(cell) is State.ELSEWHERE
        two.finish(second, result(cell))
        one.finish(first, result(cell))
        (folder / "leases" / f"{other.key}.1").write_bytes(b"\xff{")
        assert one.lease(other) == Lease(other, 2)
        one.finish(Lease(other, 2), result(other))
    lines = [line for path in (folder / "rows").glob("*.jsonl") for line in path.read_bytes().splitlines()]
    assert len(lines) == 2
    assert not list((folder / "leases").iterdir())


def at_once(count: int, work: Callable[[], object]) -> None:
    """Do work in so many threads; an error in one is raised."""
    with ThreadPoolExecutor(count) as threads:
        for future in [threads.submit(work) for _ in range(count)]:
            future.result()


def test_of_many_drivers_that_lease_the_same_cells_one_gets_each(tmp_path: Path) -> None:
    chosen = cells(60)
    leased_keys: list[str] = []

    def work() -> None:
        with Driver(tmp_path / "ledger") as driver:
            for cell in chosen:
                lease = driver.lease(cell)
                if isinstance(lease, Lease):
                    leased_keys.append(cell.key)
                    driver.finish(lease, result(cell))

    at_once(6, work)
    assert sorted(leased_keys) == sorted(cell.key for cell in chosen)
    assert len(list(Ledger(tmp_path / "ledger").rows())) == 60
    assert not list((tmp_path / "ledger" / "leases").iterdir())


def test_what_a_dead_driver_left_behind_goes_away(tmp_path: Path) -> None:
    folder = filled(tmp_path / "ledger", 1)
    leases = folder / "leases"
    (leases / f"{cells(1)[0].key}.1").write_text("{}")  # its row was written, its lease not yet given up
    (leases / f"{'0' * 64}.2").write_text("{}")
    (folder / "quarantine" / f"{'0' * 64}.json").write_text("{}")  # quarantined, its leases not yet given up
    (leases / ".unnamed").write_text("")
    os.utime(leases / ".unnamed", (0, 0))
    filled(folder, 1)
    assert not list(leases.iterdir())
    assert len(list((folder / "rows").iterdir())) == 2  # a driver that wrote nothing leaves nothing


def test_many_drivers_may_make_the_same_ledger_at_once(tmp_path: Path) -> None:
    (tmp_path / "ledger" / "rows").mkdir(parents=True)
    (tmp_path / "ledger" / ".ledger.json.0123").write_text("")
    assert len(Driver(tmp_path / "ledger").ledger) == 0
    at_once(8, lambda: Driver(tmp_path / "new"))


def test_a_system_without_flock_reads_ledgers(tmp_path: Path) -> None:
    folder = filled(tmp_path / "ledger", 2)
    code = (
        "import sys; sys.modules['fcntl'] = None\n"
        "import posefit.cli, posefit.sweep.command, posefit.report.write\n"
        "from posefit.sweep.ledger import Ledger\n"
        "print(len(list(Ledger(sys.argv[1]).rows())))"
    )
    done = subprocess.run([sys.executable, "-c", code, str(folder)], capture_output=True, text=True, check=True)
    assert done.stdout == "2\n"
