"""Folders and files that appear whole under their name, or not at all.

Files are first written in the same folder, under a random name that begins with a dot.
They are created exclusively, so that nothing is written through another file or link.
A call removes only its own files, or files with the mark of an earlier call that
has ended.
"""

import errno
import glob
import json
import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Any, Self

from posefit.errors import InputError
from posefit.reading import cut, parsed_json, read_text

MARK = "unfinished.json"  # file in a folder that is being written
MAX_MARK_BYTES = 10_000_000
# errors of a rename to a name that is no longer free
_TAKEN = (errno.EEXIST, errno.ENOTEMPTY, errno.ENOTDIR)


def check_new(path: str | Path) -> None:
    """Raise InputError if `path` exists, even as a link that leads nowhere."""
    if os.path.lexists(path):
        raise _exists(path)


def check_place(path: str | Path) -> None:
    """Raise InputError if the folder of `path` is missing or cannot be written to."""
    parent = Path(path).resolve().parent
    if not parent.is_dir():
        raise InputError(f"cannot write to {path}: {parent} is not a folder")
    if not os.access(parent, os.W_OK):
        raise InputError(f"cannot write to {path}: no permission to write in {parent}")


def check_free(path: str | Path | None) -> None:
    """Raise InputError like `check_new` and `check_place`; None is always free."""
    if path is not None:
        check_new(path)
        check_place(path)


def opencv_name(path: str | Path) -> str:
    """Return a file's absolute name for OpenCV.

    OpenCV would take a relative name with a colon for an address.

    Raises:
        InputError: The name is not UTF-8. OpenCV would end the process.
    """
    name = os.path.abspath(path)
    try:
        name.encode()
    except UnicodeEncodeError:
        raise InputError(f"{path}: expected a name in UTF-8, got other bytes") from None
    return name


def new_folder(path: str | Path) -> AbstractContextManager[Path]:
    """Yield an empty folder to write to. On success it takes the name `path`.

    If the body fails, nothing is left.

    Raises:
        InputError: `path` exists, or cannot be written; the disk may be full.
    """
    return _built(Path(path), check_new, _created_folder, Path.rename)


def new_file(path: str | Path) -> AbstractContextManager[Path]:
    """Yield an empty file to write, with the suffix of `path`. It then becomes `path`.

    If the body fails, nothing is left.

    Raises:
        InputError: `path` exists, or cannot be written; the disk may be full.
    """
    return _built(Path(path), check_new, _created, _named)


def replaced_file(path: str | Path, mark: bytes) -> AbstractContextManager[Path]:
    """Yield an empty file to write. On success it replaces an earlier file.

    If the `with` block raises, the earlier file is kept.

    Args:
        path: The file.
        mark: The beginning of an earlier file. Any other file, and a link, is not
            replaced.

    Raises:
        InputError: Something else has the name, or it cannot be written; the disk may
            be full.
    """
    check = partial(check_replaceable, mark=mark)
    return _built(Path(path), check, _created, Path.replace)


def replaced_folder(
    path: str | Path, check: Callable[[Path], None], names: Sequence[str]
) -> AbstractContextManager[Path]:
    """Yield an empty folder to write to. On success it replaces an earlier folder.

    If the body fails, the earlier folder stays.

    Args:
        path: The folder.
        check: Raises InputError if something that must not be replaced has the name.
        names: Names of the files of an earlier folder. One with anything else is not
            replaced.

    Raises:
        InputError: Something else has the name, or it cannot be written; the disk may
            be full.
    """

    def name(building: Path, target: Path) -> None:
        _take_place(building, target, names)

    return _built(Path(path), check, _created_folder, name)


@contextmanager
def _built(
    target: Path,
    check: Callable[[Path], None],
    make: Callable[[Path], Path],
    name: Callable[[Path, Path], Any],
) -> Iterator[Path]:
    """Yield what `make` creates next to a target, then give it the target's name.

    If anything fails, nothing of it is left.
    """
    try:
        check(target)
        building = make(target)
        with _undone(building):
            yield building
            try:
                name(building, target)
            except OSError as error:
                # another writer may have taken the name meanwhile
                if error.errno in _TAKEN:
                    raise _exists(target) from None
                raise
    except OSError as error:
        raise InputError(
            f"cannot write to {target}: {error.strerror or error}"
        ) from error


def check_replaceable(path: str | Path, mark: bytes) -> None:
    """Raise InputError if `path` exists and is not a file that begins with `mark`.

    A link is never replaceable.
    """
    target = Path(path)
    if not os.path.lexists(target):
        return
    if target.is_file() and not target.is_symlink():
        with target.open("rb") as file:
            if file.read(len(mark)) == mark:
                return
    raise InputError(
        f"{target}: expected a new name or an earlier file of this kind, "
        "got something else"
    )


class Unfinished:
    """A hidden folder next to its target, with a mark while it is unfinished.

    It keeps the mark if it is interrupted. The mark is a file that its writer locks, so
    that others see whether the folder is in use. On systems without locks it never
    seems to be in use.

    Attributes:
        path: The folder.
        info: Content of the mark.
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
        self._made = made  # parent folders that were created with it
        self.info = info
        self._target = target
        self._file = file

    @classmethod
    def begin(cls, target: Path, info: Mapping[str, Any]) -> Self:
        """Return a new folder with a mark that contains `info`.

        Raises:
            OSError: The disk is full, or the folder cannot be created.
        """
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
        """Return the interrupted folders of a target, the latest first."""
        folders = []
        for entry in target.parent.glob(f".{glob.escape(target.name)}.*/{MARK}"):
            if entry.is_symlink() or entry.parent.is_symlink():
                continue
            with suppress(OSError, ValueError, KeyError, TypeError):
                modified = entry.stat().st_mtime
                file = os.open(entry, os.O_RDWR | getattr(os, "O_NOFOLLOW", 0))
                mark = None
                if lock(file):
                    mark = parsed_json(read_text(entry, MAX_MARK_BYTES))
                if (
                    mark is not None
                    and mark["target"] == target.name
                    and isinstance(mark["info"], dict)
                ):
                    folder = cls(target, entry.parent, file, mark["info"])
                    folders.append((modified, folder))
                else:
                    os.close(file)
        latest_first = sorted(folders, key=itemgetter(0), reverse=True)
        return [folder for _, folder in latest_first]

    def close(self) -> None:
        """Release the folder, so that it can be continued. May be called twice."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def remove(self, names: Iterable[str]) -> None:
        """Remove the files with these names, and the folder if it is then empty.

        Parent folders that were created with it are removed, too, if they are empty.
        """
        emptied(self.path, [*names, MARK])
        remove_empty(self._made)
        self.close()

    def finish(self, names: Iterable[str], replace: bool) -> None:
        """Give the folder its target's name.

        Args:
            names: Names of the result's files.
            replace: Whether to replace an earlier folder that contains only such files.

        Raises:
            OSError: The earlier folder contains anything else, or a folder with the
                target's name has appeared meanwhile.
        """
        if replace and os.path.lexists(self._target):
            _take_place(self.path, self._target, names)
        else:
            self.path.rename(self._target)
        (self._target / MARK).unlink(missing_ok=True)
        self.close()


def made_folders(folder: Path) -> list[Path]:
    """Create a folder and its parents, and return the new ones, the deepest first."""
    missing = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    return missing


def remove_empty(folders: Iterable[Path]) -> None:
    """Remove the folders that are empty."""
    for folder in folders:
        with suppress(OSError):
            folder.rmdir()


def other_entries(folder: Path, names: Iterable[str]) -> list[str]:
    """Return the entries of a folder that are not plain files with these names."""
    known = {*names, MARK}
    others = []
    for entry in folder.iterdir():
        if entry.name not in known or entry.is_symlink() or not entry.is_file():
            others.append(entry.name)
    return sorted(others)


def emptied(folder: Path, names: Iterable[str]) -> None:
    """Remove plain files by name from a folder, and the folder if it is then empty."""
    with suppress(OSError):
        for name in names:
            path = folder / name
            if path.is_file() and not path.is_symlink():
                path.unlink()
        folder.rmdir()


def lock(file: int) -> bool:
    """Lock a file, and return False if another process has locked it."""
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
    """Remove a file or a folder if the body fails."""
    try:
        yield
    except BaseException:
        with suppress(OSError):
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink()
        raise


def _exists(target: str | Path) -> InputError:
    return InputError(f"{target}: expected a new name to write to, got one that exists")


def _beside(target: Path) -> Path:
    return target.with_name(f".{target.name}.{secrets.token_hex(8)}{target.suffix}")


def _take_place(folder: Path, target: Path, names: Iterable[str]) -> None:
    """Give a folder the name of a target, which it replaces if that exists.

    Raises OSError if the target is a link, or holds anything but files with these
    names.
    """
    if not os.path.lexists(target):
        folder.rename(target)
        return
    if target.is_symlink():
        raise OSError(errno.ENOTDIR, "a link")
    if others := other_entries(target, names):
        raise OSError(errno.ENOTEMPTY, f"a folder with {cut(others[0])}")
    aside = _beside(target)
    target.rename(aside)
    try:
        folder.rename(target)
    except OSError:
        aside.rename(target)
        raise
    emptied(aside, [*names, MARK])


def _created_folder(target: Path) -> Path:
    building = _beside(target)
    building.mkdir()
    return building


def _created(target: Path) -> Path:
    """Create an empty file next to the target, and return it.

    It is created exclusively, so that it is neither a link nor somebody else's file.
    """
    building = _beside(target)
    os.close(os.open(building, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666))
    return building


def _named(building: Path, target: Path) -> None:
    """Give a file its name.

    With a hard link the file appears whole. On a file system without links one writer
    creates the name with an empty file, which the content then replaces.

    Raises:
        FileExistsError: The name is not free.
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
