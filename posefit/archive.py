"""Arrays of an .npz or .npy file that may be hostile: the size of each is checked before it is unpacked.

`numpy.load` unpacks whatever a file asks for. Here the archive's directory and the header of each array are read first:
nothing is unpacked that has another size than they say, or more bytes than the caller allows.
"""

import math
import struct
import tokenize
import warnings
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from posefit.errors import InputError
from posefit.reading import check_size, cut, quoted

MEMBERS = 1_000  # arrays of a file
HEADER = 10_000  # characters before an array, as NumPy has it
TURNED = 500_000_000  # bytes of an array that is stored column by column, which has to be unpacked whole
KINDS = "biufUS"  # booleans, numbers and text: nothing that has to be unpickled
_END, _END64 = b"PK\x05\x06", b"PK\x06\x07"  # of an archive's directory
_PACKED = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)  # as NumPy writes; others unpack a thousand times slower
# what zipfile, zlib and NumPy raise where bits were flipped or bytes are missing
_DAMAGE = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    tokenize.TokenError,
    OSError,
    ValueError,
    TypeError,
    RuntimeError,
    LookupError,
    OverflowError,
    MemoryError,
    EOFError,
    SyntaxError,
)


class _RefusedError(InputError):
    """The file holds what is not read; the message says what."""


@dataclass(frozen=True)
class Stored:
    """One array of an archive, which is not unpacked yet."""

    name: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    fortran: bool
    _path: Path = field(repr=False)
    _what: str = field(repr=False)
    _archive: zipfile.ZipFile = field(repr=False)
    _start: int = field(repr=False)  # bytes before the array

    @property
    def size(self) -> int:
        """How many bytes it unpacks to."""
        return math.prod(self.shape) * self.dtype.itemsize

    def read(self) -> NDArray[Any]:
        """Return the array."""
        with self._opened() as member:
            content = _exactly(member, self.size)
            _exactly(member, 0)
        array = np.frombuffer(content, self.dtype)
        return array.reshape(self.shape, order="F" if self.fortran else "C")

    def rows(self) -> Iterator[NDArray[Any]]:
        """Yield one row after the other, so that only one of them is in memory."""
        if self.fortran:
            if self.size > TURNED:
                raise InputError(f"{self._path}: expected {self.name} row by row, got it column by column")
            yield from self.read()
            return
        size = math.prod(self.shape[1:]) * self.dtype.itemsize
        with self._opened() as member:
            for _ in range(self.shape[0]):
                yield np.frombuffer(_exactly(member, size), self.dtype).reshape(self.shape[1:])
            _exactly(member, 0)

    @contextmanager
    def _opened(self) -> Iterator[IO[bytes]]:
        with _as_input_error(self._path, self._what), self._archive.open(f"{self.name}.npy") as member:
            _exactly(member, self._start)
            yield member


@dataclass(frozen=True)
class Held:
    """An array in memory, to be read as one of an archive is."""

    array: NDArray[Any]

    @property
    def shape(self) -> tuple[int, ...]:
        """Its shape."""
        return self.array.shape

    @property
    def dtype(self) -> np.dtype[Any]:
        """Its type."""
        return self.array.dtype

    def read(self) -> NDArray[Any]:
        """Return the array."""
        return self.array

    def rows(self) -> Iterator[NDArray[Any]]:
        """Yield one row after the other."""
        yield from self.array


def mapped(path: Path, most: int) -> Held:
    """Return the array of an .npy file, read from the disk row by row. Raises InputError where it is none."""
    check_size(path, most)
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except _DAMAGE as error:
        came = cut(" ".join(str(error).split()) or type(error).__name__)
        raise InputError(f"{path}: expected an .npy file with an array, got a damaged one: {came}") from None
    if not isinstance(array, np.ndarray):
        raise InputError(f"{path}: expected an .npy file with an array, got an archive of several")
    return Held(array)


@contextmanager
def archived(path: Path, names: Sequence[str], what: str, most: int, packed: int) -> Iterator[dict[str, Stored]]:
    """Yield those of `names` that an .npz file of at most `packed` bytes has; together they unpack to `most` at most.

    Raises InputError, also while they are read, where the file is damaged or larger; `what` describes the expected
    arrays in messages.
    """
    check_size(path, packed)
    with ExitStack() as stack:
        with _as_input_error(path, what):
            file = stack.enter_context(path.open("rb"))
            _check_directory(file)
            archive = stack.enter_context(zipfile.ZipFile(file))
            there = set(archive.namelist())
            arrays = {name: _stored(path, what, archive, name) for name in names if f"{name}.npy" in there}
            size = sum(one.size for one in arrays.values())
            if size > most:
                raise _RefusedError(f"{size / 1e9:.3g} GB when unpacked, where {most / 1e9:g} GB are the most")
        yield arrays


def read_arrays(path: Path, names: Sequence[str], what: str, most: int) -> Mapping[str, NDArray[Any]]:
    """Return those of `names` that an .npz file has, of `most` bytes together. Raises InputError as `archived` does."""
    with archived(path, names, what, most, most) as arrays:
        return {name: one.read() for name, one in arrays.items()}


def _check_directory(file: IO[bytes]) -> None:
    """Return nothing. Raises InputError where an archive's directory, which is read whole, has too many entries.

    The record that says so is looked for as zipfile does it.
    """
    size = file.seek(0, 2)
    tail = min(size, 22 + (1 << 16))
    file.seek(size - tail)
    end = file.read(tail)
    start = len(end) - 22 if end[-22:-18] == _END and end.endswith(b"\0\0") else end.rfind(_END)
    record = end[start : start + 22] if start >= 0 else b""
    if len(record) < 22:
        raise _RefusedError("a file that is none")
    count, length = struct.unpack("<10xHL6x", record)
    if max(count, length // 46) > MEMBERS or (start >= 20 and end[start - 20 : start - 16] == _END64):
        raise _RefusedError(f"one of more than {MEMBERS} arrays")


@contextmanager
def _as_input_error(path: Path, what: str) -> Iterator[None]:
    """Raise whatever a damaged archive or array raises as an InputError that names the file."""
    try:
        yield
    except _DAMAGE as error:
        text = " ".join(str(error).split()) or type(error).__name__
        came = text if isinstance(error, _RefusedError) else f"a damaged one: {cut(text)}"
        raise InputError(f"{path}: expected an .npz file with {what}, got {came}") from None


def _stored(path: Path, what: str, archive: zipfile.ZipFile, name: str) -> Stored:
    info = archive.getinfo(f"{name}.npy")
    if info.compress_type not in _PACKED:
        raise _RefusedError(f"{name} packed in a way that NumPy does not write")
    with archive.open(info) as member:
        version = np.lib.format.read_magic(member)
        if version not in ((1, 0), (2, 0)):
            raise _RefusedError(f"{name} in NumPy's format {version}")
        header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about headers as Python 2 wrote them
            shape, fortran, dtype = header(member, HEADER)
        start = member.tell()
    stored = Stored(name, shape, dtype, fortran, path, what, archive, start)
    if dtype.kind not in KINDS or not dtype.itemsize:
        raise _RefusedError(f"{name} of {cut(str(dtype))}")
    if any(side < 0 for side in shape) or stored.size != info.file_size - start:
        raise _RefusedError(f"{name} of {info.file_size - start} bytes for shape {quoted(shape)}")
    return stored


def _exactly(member: IO[bytes], count: int) -> bytes:
    """Return the next bytes; for none, see that it is the end, where the checksum is compared."""
    content = member.read(count or 1)
    if len(content) != count:
        raise EOFError("an array that ends too early" if count else "an array that is longer than it says")
    return content
