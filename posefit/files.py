"""Folders and files that appear whole under their name, or not at all: the one home of that.

- `new_folder`, `new_file`: what must not be there yet.
- `replaced_file`: what may replace an earlier file of its kind, which its first bytes tell.
- `appear`: a small file that many may want to be the first to make, such as a claim.

What is being written stands beside its place, under a random name that begins with a dot. It is created exclusively, so
that nobody's file or link is written through; and nothing is ever removed but what the call itself has made.
"""

import errno
import json
import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

# what a file system says that has no hard links
_NO_LINKS = (errno.EPERM, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EMLINK)
_TAKEN = (errno.EEXIST, errno.ENOTEMPTY, errno.ENOTDIR)  # what it says where a folder's new name is no longer free


@contextmanager
def new_folder(path: str | Path) -> Iterator[Path]:
    """Give an empty folder to write to, which takes the name `path` where nothing fails; else nothing is left.

    Raises ValueError where `path` exists or cannot be written, a full disk included.
    """
    target = Path(path)
    with _told(target):
        _check_new(target)
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
        _check_new(target)
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


def _check_new(target: Path) -> None:
    if os.path.lexists(target):
        raise _exists(target)


def _exists(target: Path) -> ValueError:
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
