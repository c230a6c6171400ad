"""The version, and digests of the sources that results depend on."""

import hashlib
import os
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

__version__ = "0.1.0"

# Packages of posefit on which no result of a sweep's cell depends
NOT_IN_RESULTS = ("cli", "page", "report", "statistics", "testing")
# what Python and its libraries write beside a source
COMPILED = "__pycache__"


def posefit_build() -> str:
    """Return the version of posefit with a digest of its sources, such as `posefit 0.1.0 3fa29b1c`."""
    return f"posefit {__version__} {source_digest('posefit', NOT_IN_RESULTS)}"


@lru_cache
def source_digest(module: str, without: tuple[str, ...] = ()) -> str:
    """Return the first 8 digits of the SHA-256 of all files of a loaded module's package, by name and content.

    Weights and tables count as its sources do; hidden files and compiled ones do not, nor do folders `without` at its
    top. Empty if the package has no file.
    """
    package = sys.modules[module.partition(".")[0]]
    digest = hashlib.sha256()
    found = False
    for name, path in _files_of(package):
        if name.partition("/")[0] in without:
            continue
        found = True
        with path.open("rb") as file:
            content = hashlib.file_digest(file, "sha256").digest()
        digest.update(f"{name}\0".encode(errors="surrogateescape") + content)
    return digest.hexdigest()[:8] if found else ""


def _files_of(package: object) -> Iterator[tuple[str, Path]]:
    """Yield the files of a package, sorted by their names in it; of a module without a folder the one it is."""
    # a package without __init__.py may have several folders
    folders = list(getattr(package, "__path__", []))
    if not folders:
        if (source := getattr(package, "__file__", None)) is not None:
            yield Path(source).name, Path(source)
        return
    seen = set[str]()
    for top in folders:
        # weights often lie behind a link to a folder; it may lead back
        for folder, inner, names in os.walk(top, followlinks=True):
            place = os.path.realpath(folder)
            if place in seen:
                inner.clear()
                continue
            seen.add(place)
            inner[:] = sorted(name for name in inner if _counts(name))
            for name in sorted(filter(_counts, names)):
                path = Path(folder, name)
                if path.is_file():
                    yield path.relative_to(top).as_posix(), path


def _counts(name: str) -> bool:
    """Return whether a file or folder of a package may decide what it does."""
    return not name.startswith(".") and name != COMPILED and not name.endswith(".pyc")
