"""Arrays of .npz and .npy files, whose sizes are checked before they are unpacked.

`numpy.load` unpacks any amount of data, which a hostile file may abuse. Here the
archive's directory and the header of each array are read first. An array is not
unpacked if its size differs from what they say, or exceeds what the caller allows.
"""

import io
import math
import sys
import warnings
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from posefit.errors import InputError
from posefit.reading import check_size, cut, quoted

# most bytes of an archive's directory, which has about a hundred per array
MAX_DIRECTORY_BYTES = 100_000
MAX_HEADER_CHARACTERS = 10_000  # of the header that NumPy writes before an array
# most bytes of an array stored column by column, which has to be unpacked whole
MAX_COLUMN_MAJOR_BYTES = 500_000_000
DTYPE_KINDS = "biufUS"  # booleans, numbers and text: anything else would be unpickled
# NumPy's own ways of packing; others unpack a thousand times slower
_PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)


class _RefusedError(InputError):
    """The file contains something that posefit refuses; the message says what."""


@dataclass(frozen=True)
class Stored:
    """One array of an archive. `numpy.asarray` or a loop over its rows unpacks it."""

    name: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    fortran: bool
    _path: Path = field(repr=False)
    _what: str = field(repr=False)
    _archive: zipfile.ZipFile = field(repr=False)
    _start: int = field(repr=False)  # bytes of the header before the array

    @property
    def nbytes(self) -> int:
        """How many bytes the array unpacks to."""
        return math.prod(self.shape) * self.dtype.itemsize

    def __array__(self, dtype: object = None, copy: object = None) -> NDArray[Any]:
        with self._opened() as member:
            content = _exactly(member, self.nbytes)
            _exactly(member, 0)
        array = np.frombuffer(content, self.dtype)
        return array.reshape(self.shape, order="F" if self.fortran else "C")

    def __iter__(self) -> Iterator[NDArray[Any]]:
        if self.fortran:
            if self.nbytes > MAX_COLUMN_MAJOR_BYTES:
                raise InputError(
                    f"{self._path}: expected {self.name} row by row, got column by "
                    f"column: save numpy.ascontiguousarray({self.name})"
                )
            yield from np.asarray(self)
            return
        size = math.prod(self.shape[1:]) * self.dtype.itemsize
        with self._opened() as member:
            for _ in range(self.shape[0]):
                row = np.frombuffer(_exactly(member, size), self.dtype)
                yield row.reshape(self.shape[1:])
            _exactly(member, 0)

    @contextmanager
    def _opened(self) -> Iterator[IO[bytes]]:
        expected = f"{self._path}: expected an .npz file with {self._what}"
        with (
            _as_input_error(expected),
            self._archive.open(f"{self.name}.npy") as member,
        ):
            _exactly(member, self._start)
            yield member


def mapped(path: Path) -> NDArray[Any]:
    """Return the array of an .npy file, read from the disk row by row.

    Raises:
        InputError: The file is not a valid .npy file.
    """
    check_size(path, sys.maxsize)
    with _as_input_error(f"{path}: expected an .npy file with an array"):
        with path.open("rb") as file:
            shape, fortran, dtype, start = _header(file, "one", path.stat().st_size)
        return np.memmap(path, dtype, "r", start, shape, "F" if fortran else "C")


@contextmanager
def archived(
    path: Path, names: Sequence[str], what: str, packed: int, *, single: bool = False
) -> Iterator[dict[str, Stored]]:
    """Yield the arrays of an .npz file by name, not unpacked yet.

    Args:
        path: The file.
        names: The arrays to look for; others are ignored.
        what: Description of the expected arrays, for messages.
        packed: Most bytes that the file may have.
        single: Whether the first of the names is required; the only array of a file
            is taken for it, whatever its name.

    Raises:
        InputError: The file is damaged or too large, or has several arrays and none of
            the first name. It may also be raised when an array is unpacked.
    """
    check_size(path, packed)
    with ExitStack() as stack:
        with _as_input_error(f"{path}: expected an .npz file with {what}"):
            file = stack.enter_context(_ArchiveFile(path))
            archive = stack.enter_context(zipfile.ZipFile(file))
            file.longest = packed
            members = set(archive.namelist())
            arrays = {}
            for name in names:
                if f"{name}.npy" in members:
                    arrays[name] = _stored(path, what, archive, name)
            if (
                single
                and len(members) == 1
                and (only := members.pop()).endswith(".npy")
            ):
                only = only.removesuffix(".npy")
                arrays = {names[0]: _stored(path, what, archive, only)}
        if single and names[0] not in arrays:
            keys = sorted(member.removesuffix(".npy") for member in members)
            raise InputError(
                f"{path}: expected an .npz file with {what}, got "
                f"{cut(', '.join(map(quoted, keys))) or 'none'}"
            )
        yield arrays


class _ArchiveFile(io.FileIO):
    """A file from which no more than `longest` bytes can be read at once.

    zipfile reads an archive's directory whole, however long it is.
    """

    longest = MAX_DIRECTORY_BYTES

    def read(self, size: int | None = -1) -> bytes:
        """Return the next bytes."""
        if size is not None and size > self.longest:
            raise _RefusedError(
                f"one whose directory is longer than {MAX_DIRECTORY_BYTES:,} bytes"
            )
        return super().read(size)


@contextmanager
def _as_input_error(expected: str) -> Iterator[None]:
    """Turn any error of a damaged archive or array into an InputError.

    Its message begins with `expected`.
    """
    try:
        yield
    # zipfile and NumPy raise many types of errors for a damaged file
    except Exception as error:
        text = " ".join(str(error).split()) or type(error).__name__
        came = f"a damaged one: {cut(text)}"
        if isinstance(error, _RefusedError):
            came = text
        raise InputError(f"{expected}, got {came}") from None


def _stored(path: Path, what: str, archive: zipfile.ZipFile, name: str) -> Stored:
    info = archive.getinfo(f"{name}.npy")
    if info.compress_type not in _PACKED:
        raise _RefusedError(f"{name} packed in a way that NumPy does not write")
    with archive.open(info) as member:
        shape, fortran, dtype, start = _header(member, name, info.file_size)
    return Stored(name, shape, dtype, fortran, path, what, archive, start)


def _header(
    file: IO[bytes], name: str, size: int
) -> tuple[tuple[int, ...], bool, np.dtype[Any], int]:
    """Return an array's shape, order and type, and where its values begin.

    Args:
        file: The array's file.
        name: The array's name, for messages.
        size: Bytes of the file.
    """
    version = np.lib.format.read_magic(file)
    # other versions are for records of very many fields, with headers of any length
    if version != (1, 0):
        raise _RefusedError(f"{name} in NumPy's format {version}")
    with warnings.catch_warnings():
        # NumPy warns about headers that Python 2 wrote
        warnings.simplefilter("ignore")
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(
            file, MAX_HEADER_CHARACTERS
        )
    start = file.tell()
    if dtype.kind not in DTYPE_KINDS or not dtype.itemsize:
        raise _RefusedError(f"{name} of {cut(str(dtype))}")
    stated_size = math.prod(shape) * dtype.itemsize
    if min(shape, default=0) < 0 or stated_size != size - start:
        raise _RefusedError(f"{name} of {size - start} bytes for shape {quoted(shape)}")
    return shape, fortran, dtype, start


def _exactly(member: IO[bytes], count: int) -> bytes:
    """Return the next `count` bytes. For 0, check that it is the end.

    At the end zipfile compares the checksum.
    """
    content = member.read(count or 1)
    if len(content) != count:
        if not count:
            raise EOFError("an array that is longer than it says")
        raise EOFError("an array that ends too early")
    return content
