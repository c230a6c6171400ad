"""The ledger: a folder in which every finished cell has its row, whatever happens to those who write to it.

ledger.json          the format of the folder
rows/NAME.jsonl      finished rows, one log a driver
rows/NAME.joints     the joints of the rows' frames
leases/KEY.n         the nth attempt at a cell: who runs it, or why it failed
quarantine/KEY.json  a cell that failed three times, and why; without this file it is tried again
aside/               damaged lines and files; their cells are run again
"""

import io
import os
import re
import sys
import zipfile
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from posefit.errors import InputError
from posefit.files import create_once
from posefit.geometry.skeleton import JOINTS as SKELETON_JOINTS
from posefit.reading import cut, parsed_json, quoted, read_text
from posefit.sweep.cell import other_version
from posefit.sweep.log import JOINTS, SUFFIX, decoded, joints_at, lines
from posefit.sweep.row import checked_quarantined, checked_row
from posefit.sweep.table import dataframe
from posefit.version import posefit_build

if TYPE_CHECKING:
    import pandas as pd

    from posefit.arrays import Array

INDEX = "ledger.json"
ROWS, LEASES, QUARANTINE, ASIDE = FOLDERS = ("rows", "leases", "quarantine", "aside")
FORMAT = 1
MAX_INDEX_BYTES = 10_000
REASON = 120  # characters of why a row is bad
MAX_JOINTS_BYTES = 100_000_000  # of a cell, unpacked
VERSION = re.compile(rb'"version": "([^"]*)"')  # in a row


class Ledger:
    """Reads a ledger, also while drivers write to it. Raises ValueError where the folder is no ledger."""

    def __init__(self, path: str | Path, say: Callable[[str], None] | None = None) -> None:
        self.path = Path(path)
        self._say = say or (lambda _: None)
        _check_format(self.path)
        self._ends: dict[str, int] = {}  # how far each log was read
        self._places: dict[str, tuple[str, int]] = {}  # of every finished row: its log, and where in it
        self._versions: dict[str, str] = {}  # of every finished row
        self._bad: dict[tuple[str, int], tuple[str, str]] = {}  # of rows that were put aside: the key, and why
        self.refresh()

    def refresh(self) -> None:
        """Read what was written since."""
        logs = self._logs()
        if any(logs.get(name, -1) < end for name, end in self._ends.items()):
            self._ends.clear()  # one was cut off or removed: everything is read again
            self._places.clear()
            self._versions.clear()
        aside = set(os.listdir(self.path / ASIDE))
        for name in sorted(logs):
            if logs[name] == self._ends.get(name, 0):
                continue
            for offset, line in lines(self.path / ROWS / name, self._ends.get(name, 0)):
                self._ends[name] = offset + len(line)
                entry = decoded(line)
                again = aside and _aside_name(name, offset) in aside
                if (entry is None or again) and self._checked(name, offset, line, entry) is None:
                    continue
                assert entry is not None
                key, row = entry
                # a row may be there twice, of a lock that a file system did not keep: the first one counts
                self._places[key] = min((name, offset), self._places.get(key, (name, offset)))
                version = VERSION.search(row)
                self._versions[key] = sys.intern(version[1].decode(errors="replace")) if version else ""

    def __len__(self) -> int:
        return len(self._places)

    def __contains__(self, key: str) -> bool:
        return key in self._places

    @property
    def version(self) -> str:
        """The versions of posefit whose results these are, with digests of its source; that of today without rows."""
        builds = {version.partition(", ")[0] for version in self._versions.values()} or {posefit_build()}
        return ", ".join(sorted(build.removeprefix("posefit ") for build in builds))

    def outdated(self) -> Counter[str]:
        """Return how many rows are of each version of posefit and plugins that is not the one installed."""
        counts = Counter(self._versions.values())
        return Counter({one: count for one, count in counts.items() if any(map(other_version, one.split(", ")))})

    def bad(self) -> list[str]:
        """Return of each row that was put aside, and whose cell has no other row: its file, its line, and why."""
        return [reason for key, reason in self._bad.values() if key and key not in self]

    def in_quarantine(self, key: str) -> bool:
        """Return whether a cell is in quarantine."""
        return (self.path / QUARANTINE / f"{key}.json").is_file()

    def quarantined_keys(self) -> set[str]:
        """Return the keys of all cells in quarantine that have no row."""
        names = (entry.name.removesuffix(".json") for entry in os.scandir(self.path / QUARANTINE) if entry.is_file())
        return {name for name in names if name not in self}

    def quarantined(self) -> list[dict[str, Any]]:
        """Return the cells in quarantine: key, spec, status, and the reason of each attempt."""
        paths = sorted((self.path / QUARANTINE).glob("*.json"))
        read = [self._read_quarantined(path) for path in paths if path.stem not in self]
        return [cell for cell in read if cell is not None]

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield every finished row, as `posefit.sweep.cell.run_cell` describes it."""
        for name in sorted(self._logs()):
            for offset, line in lines(self.path / ROWS / name):
                entry = decoded(line)
                if entry is None or self._places.get(entry[0]) != (name, offset):
                    continue
                if (row := self._checked(name, offset, line, entry)) is not None:
                    yield row

    def row(self, key: str) -> dict[str, Any]:
        """Return the row of a cell. Raises KeyError where there is none, and InputError where it is damaged."""
        name, offset = self._places[key]
        with (self.path / ROWS / name).open("rb") as file:
            file.seek(offset)
            line = file.readline()
        row = self._checked(name, offset, line, decoded(line))
        if row is None or row["key"] != key:
            raise InputError(f"{self.path / ROWS / name}: the row of cell {key[:8]} must be whole, got a damaged one")
        return row

    def all_rows(self) -> Iterator[dict[str, Any]]:
        """Yield every finished row, and then the cells in quarantine."""
        yield from self.rows()
        yield from self.quarantined()

    def joints(self, key: str) -> dict[str, "Array"]:
        """Return the joints (T, 27, 3) of a cell's frames in metres, as `estimate` and `truth`, float32."""
        start, length, checksum = self.row(key)["joints"]
        path = (self.path / ROWS / self._places[key][0]).with_suffix(JOINTS)
        data = joints_at(path, start, length)
        try:
            if zlib.crc32(data) != checksum:
                raise ValueError
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                unpacked = sum(one.file_size for one in archive.infolist())
            if unpacked <= MAX_JOINTS_BYTES:
                with np.load(io.BytesIO(data), allow_pickle=False) as stored:
                    joints: dict[str, Any] = {
                        name: np.asarray(stored[name], dtype=np.float32) for name in ("estimate", "truth")
                    }
                shapes = {one.shape for one in joints.values() if np.isfinite(one).all()}
                if len(shapes) == 1 and (shape := shapes.pop())[1:] == (len(SKELETON_JOINTS), 3) and shape[0]:
                    return joints
        except Exception:  # whatever a hostile archive raises
            pass
        raise InputError(f"{path}: the joints of cell {key[:8]} must be whole, got damaged ones")

    def frame(self) -> "pd.DataFrame":
        """Return a table of all cells, finished or quarantined; see `posefit.sweep.table`."""
        return dataframe(self.all_rows())

    def _checked(self, name: str, offset: int, line: bytes, entry: tuple[str, bytes] | None) -> dict[str, Any] | None:
        """Return the row of a line. A bad one counts no longer, and is put aside: its cell is run again."""
        try:
            if entry is None:
                raise InputError("expected a row with its checksum, got a damaged one")
            return checked_row(*entry)
        except ValueError as error:
            match = re.search(rb'"key": "([0-9a-f]{64})', line)
            key = match[1].decode() if match else ""
            reason = cut(str(error), REASON)
        if self._places.get(key) == (name, offset):
            del self._places[key], self._versions[key]
        log = self.path / ROWS / name
        with log.open("rb") as file:
            number = 1 + file.read(offset).count(b"\n")
        where = f"{log} line {number}"
        if (name, offset) not in self._bad:
            self._bad[name, offset] = key, f"{ROWS}/{name} line {number}: {reason}"
            cell = f", the row of cell {key[:8]}," if key else ""
            self._set_aside(self.path / ASIDE / _aside_name(name, offset), line, f"{where}{cell} is damaged: {reason}")
        return None

    def _set_aside(self, aside: Path, line: bytes, damage: str) -> None:
        """Keep a damaged line of a log for a human to look at."""
        if aside.exists():
            return
        try:
            aside.write_bytes(line)
        except OSError as error:
            self._say(f"warning: {damage}; it cannot be put aside: {error.strerror}; it does not count")
        else:
            self._say(f"warning: {damage}; put aside as {aside}, to be run again")

    def _logs(self) -> dict[str, int]:
        sizes = {}
        for entry in os.scandir(self.path / ROWS):
            with suppress(FileNotFoundError):  # an empty one that went away
                if entry.name.endswith(SUFFIX) and entry.is_file():
                    sizes[entry.name] = entry.stat().st_size
        return sizes

    def _read_quarantined(self, path: Path) -> dict[str, Any] | None:
        """Return the content of a file of the quarantine. A damaged one is put aside, and its cell is tried again."""
        try:
            if path.is_file():
                return checked_quarantined(path.stem, path.read_bytes())
        except FileNotFoundError:  # it is tried again just now
            return None
        except (ValueError, OSError):
            pass
        try:
            path.rename(self.path / ASIDE / path.name)
        except OSError as error:
            self._say(f"warning: {path} is damaged, and cannot be put aside: {error.strerror}; it does not count")
        else:
            self._say(f"warning: {path} is damaged; put aside, its cell is to be run again")
        return None


def _aside_name(log: str, offset: int) -> str:
    return f"{Path(log).stem}-{offset}.txt"


def create(path: Path) -> None:
    """Make a folder a ledger, if it is none yet. Raises ValueError where it cannot be one."""
    try:
        if path.exists() and not path.is_dir():
            raise InputError(f"{path}: expected a folder for the ledger, got a file")
        if not (path / INDEX).exists():
            names = sorted(entry.name for entry in os.scandir(path)) if path.is_dir() else []
            # another driver may be making the same ledger
            if strange := [name for name in names if name not in FOLDERS and not name.lstrip(".").startswith(INDEX)]:
                raise InputError(f"{path}: expected a new folder or a ledger, got one with {strange[0]}")
            for name in FOLDERS:
                (path / name).mkdir(parents=True, exist_ok=True)
            create_once(path / INDEX, {"format": FORMAT})
    except OSError as error:
        raise InputError(f"{path}: expected a folder that can be written to, got {error.strerror}") from None
    _check_format(path)


def _check_format(path: Path) -> None:
    if os.path.isfile(path):
        raise InputError(f"{path}: expected a ledger, a folder that posefit sweep wrote, got a file")
    try:
        form = parsed_json(read_text(path / INDEX, MAX_INDEX_BYTES))["format"]
    except FileNotFoundError:
        raise InputError(f"{path}: expected a ledger, a folder that posefit sweep wrote, got none") from None
    except (ValueError, KeyError, TypeError) as error:
        reason = str(error).removeprefix(f"{path / INDEX}: ")
        raise InputError(f"{path / INDEX}: expected the index of a ledger, got {cut(reason)}") from None
    if form != FORMAT:
        raise InputError(f"{path}: expected a ledger of format {FORMAT}, got {quoted(form)}")
    for name in FOLDERS:
        if not (path / name).is_dir():
            raise InputError(
                f"{path / name}: expected a folder of the ledger, got {'a file' if (path / name).exists() else 'none'}"
            )
