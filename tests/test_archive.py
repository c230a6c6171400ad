"""Arrays of hostile files: damaged ones are one line, and the size of each is known before it is unpacked."""

import io
import struct
import zipfile

import numpy as np
import pytest

from posefit.archive import archived

REFUSED = r"a.npz: expected an .npz file with the key a, got "


def read(path, most=1_000_000):
    with archived(path, ["a", "b"], "the key a", most) as arrays:
        return {name: np.asarray(stored) for name, stored in arrays.items()}


@pytest.fixture
def path(tmp_path):
    np.savez_compressed(
        tmp_path / "a.npz", a=np.arange(5000.0), b=np.array(["x", "y"]), c=np.zeros(3)
    )
    return tmp_path / "a.npz"


def test_arrays_come_back_as_numpy_wrote_them(path, tmp_path):
    arrays = read(path)
    assert set(arrays) == {"a", "b"}
    np.testing.assert_array_equal(arrays["a"], np.arange(5000.0))
    assert arrays["b"].tolist() == ["x", "y"]
    turned = np.asfortranarray(np.arange(12).reshape(3, 4))
    np.savez(tmp_path / "b.npz", a=turned)
    np.testing.assert_array_equal(read(tmp_path / "b.npz")["a"], turned)
    with archived(tmp_path / "b.npz", ["a"], "a", 10_000) as stored:
        np.testing.assert_array_equal(np.stack(list(stored["a"])), turned)


def test_objects_and_foreign_packing_and_other_sizes_are_refused(tmp_path):
    path = tmp_path / "a.npz"
    np.savez(path, a=np.array([{}], dtype=object))
    with pytest.raises(ValueError, match=REFUSED + "a of object"):
        read(path)
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.arange(9.0))
    for packing, content, message in (
        (
            zipfile.ZIP_BZIP2,
            buffer.getvalue(),
            "a packed in a way that NumPy does not write",
        ),
        (zipfile.ZIP_STORED, buffer.getvalue()[:-8], r"a of 64 bytes for shape \(9,\)"),
        (
            zipfile.ZIP_STORED,
            buffer.getvalue() + b"x",
            r"a of 73 bytes for shape \(9,\)",
        ),
        (zipfile.ZIP_STORED, b"", "a damaged one"),
        # whose header has 3 GB
        (zipfile.ZIP_STORED, b"\x93NUMPY\2\0\0\0\0\xb0", "a in NumPy's format"),
    ):
        with zipfile.ZipFile(path, "w", packing) as made:
            made.writestr("a.npy", content)
        with pytest.raises(ValueError, match=REFUSED + message):
            read(path)


def test_a_directory_of_very_many_entries_is_not_read(tmp_path):
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w") as made:
        for k in range(3_000):
            made.writestr(str(k), b"")
    content = path.read_bytes()
    end = content.rindex(b"PK\5\6")
    count, size, start = struct.unpack("<10xHLL2x", content[end:])
    # the same behind a comment so long that the 64-bit record, the one that counts, is far before the end
    record = struct.pack(
        "<4sQHHLLQQQQ", b"PK\6\6", 44, 45, 45, 0, 0, count, count, size, start
    )
    place = struct.pack("<4sLQL", b"PK\6\7", 0, end, 1)
    last = struct.pack("<4sHHHHLLH", b"PK\5\6", 0, 0, 1, 1, 46, 2**32 - 1, 65_535)
    for damaged in (content, content[:end] + record + place + last + bytes(65_535)):
        path.write_bytes(damaged)
        with pytest.raises(
            ValueError,
            match=REFUSED + "one whose directory is longer than 100,000 bytes",
        ):
            read(path)
    path.write_bytes(b"no archive")
    with pytest.raises(
        ValueError, match=REFUSED + "a damaged one: File is not a zip file"
    ):
        read(path)
