"""The version, and digests of the sources that results depend on."""

import hashlib
import sys
from functools import lru_cache
from pathlib import Path

__version__ = "0.1.0"

# Packages of posefit on which no result of a sweep's cell depends
NOT_IN_RESULTS = ("cli", "report", "statistics", "testing")
SUFFIXES = (".py", ".json", ".npz", ".toml")  # of the files that a digest is of


def posefit_build() -> str:
    """Return the version of posefit with a digest of its sources, such as `posefit 0.1.0 3fa29b1c`."""
    return f"posefit {__version__} {source_digest('posefit', NOT_IN_RESULTS)}"


@lru_cache
def source_digest(module: str, without: tuple[str, ...] = ()) -> str:
    """Return the first 8 digits of the SHA-256 of the source and data files of a loaded module's package.

    Folders `without` at its top do not count. Empty where the package has no file.
    """
    named = getattr(sys.modules[module.partition(".")[0]], "__file__", None)
    if named is None:
        return ""
    path = Path(named)
    digest = hashlib.sha256()
    for file in (
        sorted(path.parent.rglob("*")) if path.name == "__init__.py" else [path]
    ):
        place = file.relative_to(path.parent)
        if file.suffix in SUFFIXES and place.parts[0] not in without:
            digest.update(f"{place.as_posix()}\0".encode() + file.read_bytes() + b"\0")
    return digest.hexdigest()[:8]
