"""What disks, clocks and kills can do to a ledger, one after the other: no row is lost, and none is made up."""

import errno
import fcntl
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from posefit.sweep.driver import Driver, drive_cells
from posefit.sweep.ledger import Ledger
from posefit.sweep.log import on_one_machine
from tests.cases import each
from tests.sweep.fake import Instant, cells, filled, finished, leased, result

DEEP = b"[" * 200_000  # nested too deeply to be read
ROOT = Path(__file__).parents[2]
KILLS = 24
# Drivers that are gone right before their nth call that changes a disk, half of the bytes of a write being there. Each
# is a process of its own, a copy of one that has imported everything; the copies' exit statuses are printed.
KILLED = """
import os, sys
from pathlib import Path
from tests.sweep.fake import Instant, cells
from posefit.sweep.driver import drive_cells
from posefit.sweep.driver import Driver

folder, kills = Path(sys.argv[1]), int(sys.argv[2])
real = {name: getattr(os, name) for name in ("pwrite", "link", "replace", "rename", "unlink", "fsync", "mkdir")}
met = 0

def faulty(name):
    def call(*words, **named):
        global met
        met += 1
        if met == last:
            if name == "pwrite":
                real[name](words[0], words[1][: len(words[1]) // 2], words[2])
            os.kill(os.getpid(), 9)
        return real[name](*words, **named)
    return call

for last in range(1, kills + 1):
    child = os.fork()
    if child:
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
        continue
    for name in real:
        setattr(os, name, faulty(name))
    with Driver(folder) as driver:
        drive_cells(cells(1 + last // 4), driver, Instant(), lambda _: None)
    os._exit(0)
"""


def test_a_driver_may_be_killed_before_any_call_that_changes_the_disk(tmp_path: Path) -> None:
    folder = tmp_path / "ledger"
    words = [sys.executable, "-c", KILLED, str(folder), str(KILLS)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    statuses = [int(line) for line in done.stdout.split()]
    assert set(statuses) == {0, -9}, done.stderr
    assert len(statuses) == KILLS
    wanted = {cell.key for cell in cells(1 + KILLS // 4)}
    filled(folder, len(wanted))
    ledger = Ledger(folder, pytest.fail)  # nothing is damaged but what has no end
    keys = [row["key"] for row in ledger.rows()]
    assert len(keys) == len(set(keys)) == len(wanted)
    for key in keys:
        assert ledger.joints(key)["truth"].shape == (1, 27, 3)
    assert not ledger.quarantined()


def test_a_log_that_is_cut_off_behind_its_driver_takes_no_later_row_with_it(tmp_path: Path) -> None:
    folder, chosen = tmp_path / "ledger", cells(3)
    messages: list[str] = []
    with Driver(folder, messages.append) as driver:
        for k, cell in enumerate(chosen):
            finished(driver, cell)
            if k == 1:
                (log,) = (folder / "rows").glob("*.jsonl")
                os.truncate(log, log.stat().st_size - 40)
    assert {row["key"] for row in Ledger(folder).rows()} == {chosen[0].key, chosen[2].key}
    assert len(messages) == 1
    filled(folder, 3)


def test_a_log_that_is_removed_ends_the_sweep_in_one_line(tmp_path: Path) -> None:
    expected = "got a log that was removed; 0 of 2 cells are done and safe"
    with Driver(tmp_path / "ledger") as driver:
        for path in (tmp_path / "ledger" / "rows").iterdir():
            path.unlink()
        with pytest.raises(ValueError, match=expected):
            drive_cells(cells(2), driver, Instant(), print)


@each("content", [b'{"key"', DEEP, b"\xff"])
def test_a_damaged_file_of_the_quarantine_is_put_aside_and_its_cell_is_tried_again(
    content: bytes, tmp_path: Path
) -> None:
    folder = filled(tmp_path / "ledger", 1)
    bad = folder / "quarantine" / f"{cells(2)[1].key}.json"
    bad.write_bytes(content)
    messages: list[str] = []
    assert Ledger(folder, messages.append).quarantined() == []
    assert len(messages) == 1
    assert (folder / "aside" / bad.name).read_bytes() == content
    filled(folder, 2)


LEASE = '{"driver": "20260101T000000-00000000", "process": 1, "host": "h", "rows": 0, '


@each(
    "content",
    [
        b'{"driver"',
        DEEP,
        b"\xff",
        b"{}",
        (LEASE + '"gailed": "it had to", "own": true}').encode(),  # one bit of "failed"
        (LEASE + '"failed": 1, "own": true}').encode(),
    ],
)
def test_a_damaged_lease_holds_nothing(content: bytes, tmp_path: Path) -> None:
    folder, cell = tmp_path / "ledger", cells(1)[0]
    with Driver(folder) as driver:
        (folder / "leases" / f"{cell.key}.1").write_bytes(content)
        assert leased(driver, cell).attempt == 2


def test_folders_and_pipes_among_the_files_of_a_ledger_are_left_alone(tmp_path: Path) -> None:
    folder = filled(tmp_path / "ledger", 1)
    first, second = (cell.key for cell in cells(2))
    for name in (
        "rows/x.jsonl",
        "rows/y.joints",
        f"leases/{first}.1",
        f"leases/{second}.1",
        f"quarantine/{second}.json",
    ):
        (folder / name).mkdir()
    for name in ("rows/pipe.jsonl", f"leases/{second}.2"):
        os.mkfifo(folder / name)
    filled(folder, 2)
    ledger = Ledger(folder, pytest.fail)
    assert len(list(ledger.rows())) == 2
    assert ledger.quarantined() == []


@each("step", [-86_400.0, 86_400.0])
def test_a_clock_that_is_set_back_or_ahead_changes_nothing(step: float, tmp_path: Path, monkeypatch: Any) -> None:
    folder, clock = tmp_path / "ledger", time.time
    with Driver(folder) as one:
        lease = leased(one, cells(1)[0])
        (folder / "leases" / ".half").write_text("")  # what another one is writing just now
        monkeypatch.setattr(time, "time", lambda: clock() + step)
        monkeypatch.setattr(time, "gmtime", lambda: time.localtime(clock() + step))
        filled(folder, 3, start=1)
        assert (folder / "leases" / ".half").exists()
        one.finish(lease, result(cells(1)[0]))
    filled(folder, 4)
    assert len(list(Ledger(folder).rows())) == 4


@each("number", [errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP])
def test_a_disk_without_locks_is_refused_and_nothing_is_left(number: int, tmp_path: Path, monkeypatch: Any) -> None:
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", refuse)
    with pytest.raises(ValueError, match=r"ledger: expected a disk that keeps locks \(flock\), got "):
        Driver(tmp_path / "ledger").__enter__()
    assert not list((tmp_path / "ledger" / "rows").iterdir())


def test_a_disk_that_forgets_locks_is_refused(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setattr(fcntl, "flock", lambda *_: None)
    with pytest.raises(ValueError, match=r"expected a disk that keeps locks \(flock\), got one that forgets them"):
        Driver(tmp_path / "ledger").__enter__()


@each(
    ("mount", "reason"),
    [
        ("nfs rw - nfs host:/x rw,vers=3,local_lock=none", None),
        ("nfs rw - nfs host:/x rw,vers=3,local_lock=all", "nfs local_lock=all"),
        ("nfs rw - nfs host:/x rw,vers=3,nolock,local_lock=flock", "nfs nolock"),
        ("nfs rw - nfs4 host:/x rw,vers=4.2,local_lock=none", None),
        ("nfs rw - fuse.sshfs host:/x rw", "fuse.sshfs"),
        ("nfs rw - lustre host:/x rw,localflock", "lustre localflock"),
        ("nfs rw - ext4 /dev/sda1 rw", None),
    ],
)
def test_a_mount_whose_locks_stay_on_one_machine_is_known(mount: str, reason: str | None, tmp_path: Path) -> None:
    place, _, rest = mount.partition(" ")
    (tmp_path / "a b" / place / "ledger").mkdir(parents=True)
    escaped = str(tmp_path / "a b" / place).replace(" ", "\\040")  # proc(5)
    mounts = tmp_path / "mountinfo"
    mounts.write_text(f"1 0 8:1 / / rw - ext4 /dev/sda2 rw\n36 35 98:0 / {escaped} {rest}\n")
    assert on_one_machine(tmp_path / "a b" / place / "ledger", mounts) == reason
    assert on_one_machine(tmp_path, mounts) is None
    assert on_one_machine(tmp_path, tmp_path / "nothing") is None


def test_where_locks_stay_on_one_machine_another_ones_cells_are_not_judged(tmp_path: Path, monkeypatch: Any) -> None:
    folder, driver = tmp_path / "ledger", "posefit.sweep.driver"
    with Driver(folder) as there, Driver(folder) as here:
        monkeypatch.setattr("socket.gethostname", lambda: "there")
        leased(there, cells(1)[0])
        monkeypatch.setattr("socket.gethostname", lambda: "here")
        monkeypatch.setattr(f"{driver}.on_one_machine", lambda _: "nfs nolock")
        with pytest.raises(ValueError, match="a disk whose locks other machines see, got nfs nolock, and there"):
            here.lease(cells(1)[0])
    monkeypatch.setattr(f"{driver}.on_one_machine", lambda _: None)
    filled(folder, 1)
