"""Folders and files that appear whole under their name, or not at all.

Files are written beside their place, under a random name that begins with a dot. They are created exclusively, so that
no other file or link is written through; and nothing is ever removed but what the call itself has made, or what carries
the mark of an earlier one that has ended.
"""

import errno
import glob
import json
import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from operator import itemgetter
from pathlib import Path
from typing import Any, Self

from posefit.errors import InputError
from posefit.reading import cut, parsed_json, read_text

MARK = "unfinished.json"  # in a folder that is being written
MAX_MARK_BYTES = 10_000_000
# errors of a rename to a name that is no longer free
_TAKEN = (errno.EEXIST, errno.ENOTEMPTY, errno.ENOTDIR)


def check_new(path: str | Path) -> None:
    """Raise InputError where `path` exists, be it a link that leads nowhere."""
    if os.path.lexists(path):
        raise _exists(path)


def check_place(path: str | Path) -> None:
    """Raise InputError where `path` is in no folder, or in one that cannot be written to."""
    parent = Path(path).resolve().parent
    if not parent.is_dir():
        raise InputError(f"cannot write to {path}: {parent} is not a folder")
    if not os.access(parent, os.W_OK):
        raise InputError(f"cannot write to {path}: no permission to write in {parent}")


def check_free(path: str | Path | None) -> None:
    """Raise InputError as `check_new` and `check_place` do, where there is a path."""
    if path is not None:
        check_new(path)
        check_place(path)


def opencv_name(path: str | Path) -> str:
    """Return a file's absolute name, as OpenCV needs it: a relative one with a colon would be an address.

    Raises InputError where it is no UTF-8, with which OpenCV would end the process.
    """
    name = os.path.abspath(path)
    try:
        name.encode()
    except UnicodeEncodeError:
        raise InputError(
            f"{path}: expected a name in UTF-8, got one that is not"
        ) from None
    return name


def new_folder(path: str | Path) -> AbstractContextManager[Path]:
    """Yield an empty folder to write to, which takes the name `path` where nothing fails; else nothing is left.

    Raises InputError where `path` exists or cannot be written, a full disk included.
    """
    return _built(Path(path), check_new, _created_folder, Path.rename)


def new_file(path: str | Path) -> AbstractContextManager[Path]:
    """Yield an empty file to write, which becomes `path` where nothing fails; else nothing is left.

    It has the suffix of `path`. Raises InputError where `path` exists or cannot be written, a full disk included.
    """
    return _built(Path(path), check_new, _created, _named)


def replaced_file(path: str | Path, mark: bytes) -> AbstractContextManager[Path]:
    """Yield an empty file to write, which takes the place of an earlier one where nothing fails; else that one stays.

    Only a file that begins with `mark` is replaced, and no link. Raises InputError where something else has the name,
    or it cannot be written, a full disk included.
    """

    def check(target: Path) -> None:
        if not replaceable(target, mark):
            raise InputError(
                f"{target}: expected a new name or an earlier file of this kind, got something else"
            )

    return _built(Path(path), check, _created, Path.replace)


@contextmanager
def _built(
    target: Path,
    check: Callable[[Path], None],
    make: Callable[[Path], Path],
    name: Callable[[Path, Path], Any],
) -> Iterator[Path]:
    """Yield what `make` creates beside a target, and give it its name; whatever fails, nothing of it is left."""
    try:
        check(target)
        building = make(target)
        with _undone(building):
            yield building
            try:
                name(building, target)
            except OSError as error:  # another writer's has come meanwhile
                raise _exists(target) if error.errno in _TAKEN else error from None
    except OSError as error:
        raise InputError(
            f"{target}: expected a place to write to, got {error.strerror or error}"
        ) from error


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
    """A hidden folder beside its target, which carries a mark while it is written, and after that was interrupted.

    The mark is a file that its writer holds a lock on, so that others see whether it is in use. Where there are no
    locks, it seems not to be.
    """

    def __init__(
        self,
        target: Path,
        path: Path,
        file: int,
        info: Mapping[str, Any],
        made: Sequence[Path] = (),
    ) -> None:
        self.path = path
        # folders above it that are as new as it is
        self._made = made
        self.info = info
        self._target = target
        self._file = file

    @classmethod
    def begin(cls, target: Path, info: Mapping[str, Any]) -> Self:
        """Return a new folder, whose mark holds `info`. Raises OSError where there is no room."""
        made = made_folders(target.parent)
        path = _created_folder(target)
        with _undone(path):
            file = os.open(path / MARK, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
            lock(file)
            (path / MARK).write_text(
                json.dumps({"target": target.name, "info": info}), encoding="utf-8"
            )
        return cls(target, path, file, info, made)

    @classmethod
    def interrupted(cls, target: Path) -> list[Self]:
        """Return the folders of a target that carry a mark and are not in use, the latest first."""
        folders = []
        for entry in target.parent.glob(f".{glob.escape(target.name)}.*/{MARK}"):
            if entry.is_symlink() or entry.parent.is_symlink():
                continue
            with suppress(OSError, ValueError, KeyError, TypeError):
                modified = entry.stat().st_mtime
                file = os.open(entry, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
                mark = (
                    parsed_json(read_text(entry, MAX_MARK_BYTES))
                    if lock(file)
                    else None
                )
                if (
                    mark is not None
                    and mark["target"] == target.name
                    and isinstance(mark["info"], dict)
                ):
                    folders.append(
                        (modified, cls(target, entry.parent, file, mark["info"]))
                    )
                else:
                    os.close(file)
        return [
            folder for _, folder in sorted(folders, key=itemgetter(0), reverse=True)
        ]

    def close(self) -> None:
        """Release the folder, so that it can be continued; a second call does nothing."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def remove(self, names: Iterable[str]) -> None:
        """Remove the entries of these names, and the folder where nothing else is in it, with those made for it."""
        emptied(self.path, [*names, MARK])
        remove_empty(self._made)
        self.close()

    def finish(self, names: Iterable[str], replace: bool) -> None:
        """Give the folder its target's name; with `replace` it may be an earlier one's, with files of these names.

        Raises OSError where that one holds anything else, or a folder of that name has appeared meanwhile.
        """
        names = [*names, MARK]
        aside = None
        if replace and os.path.lexists(self._target):
            if self._target.is_symlink():
                raise OSError(errno.ENOTDIR, "a link")
            if others := other_entries(self._target, names):
                raise OSError(errno.ENOTEMPTY, f"a folder with {cut(others[0])}")
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


def made_folders(folder: Path) -> list[Path]:
    """Create a folder and its parents, and return the new ones, the deepest first."""
    missing = [one for one in (folder, *folder.parents) if not one.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    return missing


def remove_empty(folders: Iterable[Path]) -> None:
    """Remove those of some folders that are empty."""
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()


def other_entries(folder: Path, names: Iterable[str]) -> list[str]:
    """Return the entries of a folder that are no plain files of these names, sorted."""
    known = {*names, MARK}
    return sorted(
        entry.name
        for entry in folder.iterdir()
        if entry.name not in known or entry.is_symlink() or not entry.is_file()
    )


def emptied(folder: Path, names: Iterable[str]) -> None:
    """Remove the plain files of these names from a folder, and the folder once it is empty."""
    with suppress(OSError):
        for path in (folder / name for name in names):
            if path.is_file() and not path.is_symlink():
                path.unlink()
        folder.rmdir()


def lock(file: int) -> bool:
    """Lock a file; return False where another process has."""
    try:
        import fcntl
    except ImportError:  # an operating system without it
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


@contextmanager
def _undone(path: Path) -> Iterator[None]:
    """Remove a file or a folder where the body fails."""
    try:
        yield
    except BaseException:
        with suppress(OSError):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        raise


def _exists(target: str | Path) -> InputError:
    return InputError(f"{target}: expected a new name to write to, got one that exists")


def _beside(target: Path) -> Path:
    return target.with_name(f".{target.name}.{secrets.token_hex(8)}{target.suffix}")


def _created_folder(target: Path) -> Path:
    building = _beside(target)
    building.mkdir()
    return building


def _created(target: Path) -> Path:
    """Return an empty file beside the target, created exclusively, so that it is no link and no other's file."""
    building = _beside(target)
    os.close(os.open(building, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
    return building


def _named(building: Path, target: Path) -> None:
    """Give a file its name where that is free. Raises FileExistsError where it is not.

    With a hard link the file appears whole. A file system without links lets one writer create the name, which is
    empty until its content replaces it.
    """
    try:
        os.link(building, target)
    except FileExistsError:
        raise
    except (OSError, AttributeError, NotImplementedError):
        os.close(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
        with _undone(target):
            building.replace(target)
    else:
        building.unlink()
