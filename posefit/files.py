"""Folders and files that appear whole under their name, or not at all."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def new_folder(path: str | Path) -> Iterator[Path]:
    """Give an empty folder to write to, which takes the name `path` where nothing fails; else nothing is left.

    Raises ValueError where `path` exists or cannot be written, a full disk included.
    """
    target = Path(path)
    with _building(target) as building:
        building.mkdir()
        yield building


@contextmanager
def new_file(path: str | Path) -> Iterator[Path]:
    """Give the name of a file to write, which becomes `path` where nothing fails; else nothing is left.

    It has the suffix of `path`. Raises ValueError where `path` exists or cannot be written, a full disk included.
    """
    with _building(Path(path)) as building:
        yield building


@contextmanager
def _building(target: Path) -> Iterator[Path]:
    building = target.with_name(f".{target.stem}.partial{target.suffix}")
    try:
        if target.exists():
            raise ValueError(f"{target}: expected a new name to write to, got one that exists")
        _remove(building)  # of a run that was killed
        try:
            yield building
            building.rename(target)
        except BaseException:
            _remove(building)
            raise
    except OSError as error:
        raise ValueError(f"{target}: expected a place to write to, got {error.strerror or error}") from error


def _remove(path: Path) -> None:
    with suppress(OSError):  # what cannot be removed will be in the way, and said, or is already gone
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
