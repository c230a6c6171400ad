"""The version, and digests of the sources that results depend on."""

import hashlib
import os
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

__version__ = "0.1.0"

# packages of posefit that no result of a sweep's cell depends on
NOT_IN_RESULTS = ("cli", "page", "report", "statistics", "testing")
# folder that Python and its libraries write into a package
COMPILED = "__pycache__"


def posefit_build() -> str:
    """Return posefit's version with a digest of its sources.

    An example is `posefit 0.1.0 3fa29b1c`.
    """
    return f"posefit {__version__} {source_digest('posefit', NOT_IN_RESULTS)}"


@lru_cache
def source_digest(module: str, without: tuple[str, ...] = ()) -> str:
    """Return the first 8 digits of the SHA-256 of a loaded module's whole package.

    It covers names and contents of all files, weights and tables included. Hidden files
    and compiled ones are ignored.

    Args:
        module: Name of the module.
        without: Folders at the top of the package that are ignored, too.

    Returns:
        The digits, or "" if the package has no file.
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
    if found:
        return digest.hexdigest()[:8]
    return ""


def _files_of(package: object) -> Iterator[tuple[str, Path]]:
    """Yield the files of a package with their names in it, sorted.

    A module that is not in a folder is one file.
    """
    # a package without __init__.py may have several folders
    folders = list(getattr(package, "__path__", []))
    if not folders:
        if (source := getattr(package, "__file__", None)) is not None:
            yield Path(source).name, Path(source)
        return
    seen = set[str]()
    for top in folders:
        # weights are often behind a link to a folder; it may lead back
        for folder, inner, names in os.walk(top, followlinks=True):
            place = os.path.realpath(folder)
            if place in seen:
                inner.clear()
                continue
            seen.add(place)
            inner[:] = sorted(filter(_counts, inner))
            for name in sorted(filter(_counts, names)):
                path = Path(folder, name)
                if path.is_file():
                    yield path.relative_to(top).as_posix(), path


def _counts(name: str) -> bool:
    """Return whether a file or folder of a package can affect its results."""
    return not name.startswith(".") and name != COMPILED and not name.endswith(".pyc")
