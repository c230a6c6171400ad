"""Folders and files that appear whole under their name, or not at all: the one home of that.

- `new_folder`, `new_file`: what must not be there yet.
- `replaced_file`: what may replace an earlier file of its kind, which its first bytes tell.
- `Unfinished`: a folder that is worked on for so long that it may have to be gone on with later.
- `check_new`, `check_place`: what is refused before anything is computed for a new name.
- `appear`: a small file that many may want to be the first to make, such as a claim.

What is being written stands beside its place, under a random name that begins with a dot. It is created exclusively, so
that nobody's file or link is written through; and nothing is ever removed but what the call itself has made, or what
carries the mark of an earlier one that has ended.
"""

import errno
import fcntl
import glob
import json
import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Self

from posefit.reading import cut, parsed_json, read_text

MARK = "unfinished.json"  # in a folder that we work on
LARGEST_MARK = 10_000_000  # bytes
# what a file system says that has no hard links
_NO_LINKS = (errno.EPERM, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EMLINK)
_TAKEN = (errno.EEXIST, errno.ENOTEMPTY, errno.ENOTDIR)  # what it says where a folder's new name is no longer free


def check_new(path: str | Path) -> None:
    """Return nothing. Raises ValueError where `path` exists, be it a link that leads nowhere."""
    if os.path.lexists(path):
        raise _exists(path)


def check_place(path: str | Path) -> None:
    """Return nothing. Raises ValueError where `path` is in no folder, or in one that cannot be written to."""
    parent = Path(path).resolve().parent
    if not parent.is_dir() or not os.access(parent, os.W_OK):
        raise ValueError(f"{path}: expected a place to write to, got one in {parent}, which is none")


@contextmanager
def new_folder(path: str | Path) -> Iterator[Path]:
    """Give an empty folder to write to, which takes the name `path` where nothing fails; else nothing is left.

    Raises ValueError where `path` exists or cannot be written, a full disk included.
    """
    target = Path(path)
    with _told(target):
        check_new(target)
        building = _beside(target)
        building.mkdir()
        with _undone(lambda: shutil.rmtree(building)):
            yield building
            try:
                building.rename(target)
            except OSError as error:  # another writer's folder has come meanwhile
                if error.errno in _TAKEN:
                    raise _exists(target) from None
                raise


@contextmanager
def new_file(path: str | Path) -> Iterator[Path]:
    """Give an empty file to write, which becomes `path` where nothing fails; else nothing is left.

    It has the suffix of `path`. Raises ValueError where `path` exists or cannot be written, a full disk included.
    """
    target = Path(path)
    with _told(target):
        check_new(target)
        building = _created(target)
        with _undone(building.unlink):
            yield building
            try:
                _named(building, target)
            except FileExistsError:  # another writer's file has come meanwhile
                raise _exists(target) from None


@contextmanager
def replaced_file(path: str | Path, mark: bytes) -> Iterator[Path]:
    """Give an empty file to write, which takes the place of an earlier one where nothing fails; else that one stays.

    Only a file that begins with `mark` is replaced, and no link. Raises ValueError where something else has the name,
    or it cannot be written, a full disk included.
    """
    target = Path(path)
    with _told(target):
        if not replaceable(target, mark):
            raise ValueError(f"{target}: expected a new name or an earlier file of this kind, got something else")
        building = _created(target)
        with _undone(building.unlink):
            yield building
            building.replace(target)


def replaceable(path: str | Path, mark: bytes) -> bool:
    """Return whether nothing has a name, or a file that begins with `mark`, which is no link."""
    target = Path(path)
    if not os.path.lexists(target):
        return True
    if target.is_symlink() or not target.is_file():
        return False
    with target.open("rb") as file:
        return file.read(len(mark)) == mark


class Unfinished:
    """A hidden folder beside its target, which carries our mark while it is worked on and where that ended too early.

    The mark is a file that its worker holds a lock on, so that everybody sees whether somebody is at work. Where a file
    system has no locks, nobody seems to be.
    """

    def __init__(self, target: Path, path: Path, file: int, told: Mapping[str, Any]) -> None:
        self.path, self.told = path, told
        self._target, self._file = target, file

    @classmethod
    def begun(cls, target: Path, told: Mapping[str, Any]) -> Self:
        """Return a new folder, whose mark says what is `told`. Raises OSError where there is no room."""
        target.parent.mkdir(parents=True, exist_ok=True)
        path = _beside(target)
        path.mkdir()
        with _undone(lambda: shutil.rmtree(path)):
            file = os.open(path / MARK, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
            with _undone(lambda: os.close(file)):
                _locked(file)
                (path / MARK).write_text(json.dumps({"target": target.name, "told": told}), encoding="utf-8")
        return cls(target, path, file, told)

    @classmethod
    def left(cls, target: Path) -> list[Self]:
        """Return those of a target that carry our mark and nobody works on, the latest first."""
        found = []
        for entry in sorted(target.parent.glob(f".{glob.escape(target.name)}.*/{MARK}"), key=_age):
            if entry.is_symlink() or entry.parent.is_symlink():
                continue
            with suppress(OSError, ValueError, KeyError, TypeError):
                file = os.open(entry, os.O_RDWR | os.O_NOFOLLOW)
                mark = parsed_json(read_text(entry, LARGEST_MARK)) if _locked(file) else None
                if mark is not None and mark["target"] == target.name and isinstance(mark["told"], dict):
                    found.append(cls(target, entry.parent, file, mark["told"]))
                else:
                    os.close(file)
        return found[::-1]

    def close(self) -> None:
        """Leave the folder to whoever goes on with it; again does nothing."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def remove(self, names: Iterable[str]) -> None:
        """Remove the folder with what of it has these names; where there is more, all that stays."""
        emptied(self.path, [*names, MARK])
        self.close()

    def finish(self, names: Iterable[str]) -> None:
        """Give the folder its target's name. Of an earlier folder of that name, what has these names is removed.

        Raises OSError where that one holds anything else, or has come meanwhile.
        """
        names = [*names, MARK]
        aside = None
        if os.path.lexists(self._target):
            if strange := strangers(self._target, names):
                raise OSError(errno.ENOTEMPTY, f"a folder with {cut(strange[0])}")
            aside = _beside(self._target)
            self._target.rename(aside)
        try:
            self.path.rename(self._target)
        except OSError:
            if aside is not None:
                aside.rename(self._target)
            raise
        (self._target / MARK).unlink(missing_ok=True)
        if aside is not None:
            emptied(aside, names)
        self.close()


def strangers(folder: Path, names: Iterable[str]) -> list[str]:
    """Return what a folder holds that has none of these names, sorted."""
    known = {*names, MARK}
    return sorted(entry.name for entry in folder.iterdir() if entry.name not in known)


def emptied(folder: Path, names: Iterable[str]) -> None:
    """Remove what has these names from a folder, and the folder where nothing is left; a link is only unlinked."""
    with suppress(OSError):
        if folder.is_symlink():
            folder.unlink()
            return
        for path in (folder / name for name in names):
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)
        folder.rmdir()


def _locked(file: int) -> bool:
    """Lock a file; return whether nobody else has."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


def _age(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except OSError:
        return 0.0


def appear(path: Path, content: object) -> bool:
    """Write a file that appears whole, and only where nothing has its name; return whether it did.

    Bytes are written as they are, anything else as JSON. Of any number of writers exactly one is told that it was the
    one. Raises OSError where there is no room.
    """
    building = _created(path)
    try:
        building.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
        os.link(building, path)
    except FileExistsError:
        return False
    finally:
        building.unlink(missing_ok=True)
    return True


@contextmanager
def _told(target: Path) -> Iterator[None]:
    """Tell what the operating system says as a user's mistake."""
    try:
        yield
    except OSError as error:
        raise ValueError(f"{target}: expected a place to write to, got {error.strerror or error}") from error


@contextmanager
def _undone(remove: Callable[[], None]) -> Iterator[None]:
    """Remove what was begun where anything fails."""
    try:
        yield
    except BaseException:
        with suppress(OSError):
            remove()
        raise


def _exists(target: str | Path) -> ValueError:
    return ValueError(f"{target}: expected a new name to write to, got one that exists")


def _beside(target: Path) -> Path:
    """Return a name in the target's folder that nobody can guess."""
    return target.with_name(f".{target.name}.{secrets.token_hex(8)}{target.suffix}")


def _created(target: Path) -> Path:
    """Return an empty file beside the target; created exclusively, so that it is no link and nobody else's."""
    building = _beside(target)
    os.close(os.open(building, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
    return building


def _named(building: Path, target: Path) -> None:
    """Give a file its name, where nothing has it. Raises FileExistsError where something does."""
    try:
        os.link(building, target)
    except OSError as error:
        if error.errno not in _NO_LINKS:
            raise
        if os.path.lexists(target):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST)) from None
        building.rename(target)
    else:
        building.unlink()
