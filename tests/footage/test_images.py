"""Images that may be hostile: their size is known before they are decoded."""

import struct
import zlib
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL.PngImagePlugin import PngInfo

from posefit.footage import images
from posefit.footage.images import read_image, read_values
from posefit.footage.readers import read_masks
from tests.cases import each


def test_pictures_come_as_opencv_decodes_them(tmp_path: Path) -> None:
    drawn = np.random.default_rng(0).integers(0, 255, (37, 53, 3), dtype=np.uint8)
    for image, suffixes in ((drawn, "png jpg bmp tif ppm"), (drawn[..., 0], "png jpg bmp tif pgm")):
        for suffix in suffixes.split():
            path = tmp_path / f"a.{suffix}"
            assert cv2.imwrite(str(path), image)
            for grey, flag in ((True, cv2.IMREAD_GRAYSCALE), (False, cv2.IMREAD_COLOR)):
                wanted = cv2.imread(str(path), flag)  # libpng rounds greys down
                np.testing.assert_allclose(read_image(path, grey=grey), wanted, rtol=0.0, atol=float(grey))


def bomb(path: Path, side: int) -> None:
    """Write a PNG file whose header states a size and whose pixels are not there."""
    chunk = b"IHDR" + struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    content = zlib.compress(bytes(100))
    data = b"IDAT" + content
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + struct.pack(">I", 13) + chunk + struct.pack(">I", zlib.crc32(chunk))
        + struct.pack(">I", len(content)) + data + struct.pack(">I", zlib.crc32(data))
        + bytes(4) + b"IEND" + struct.pack(">I", zlib.crc32(b"IEND"))
    )  # fmt: skip


def test_a_picture_of_too_many_pixels_is_refused_before_it_is_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(images.Image.Image, "convert", None)
    for side, came in ((8_000, "8000x8000"), (12_000, "12000x12000"), (30_000, "far more")):
        bomb(tmp_path / "a.png", side)
        with pytest.raises(ValueError, match=f"a.png: expected at most 50 million pixels, got {came}"):
            read_masks(tmp_path, (None, None))


def test_a_chunk_that_says_it_has_more_than_the_file_is_refused(tmp_path: Path) -> None:
    bomb(tmp_path / "a.png", 30)
    content = (tmp_path / "a.png").read_bytes()
    (tmp_path / "a.png").write_bytes(content[:33] + b"\x7f" + content[34:])
    assert read_image(tmp_path / "a.png", grey=True) is None


def tiff(fields: Sequence[tuple[int, int, int]]) -> bytes:
    """Return a TIFF file of 8 bits a pixel, all 0, that has these fields (tag, type, value) for its size."""
    data = zlib.compress(bytes(10_000))
    others = [(258, 3, 8), (259, 3, 8), (262, 3, 1), (273, 4, -1), (277, 3, 1), (278, 4, 60_000), (279, 4, len(data))]
    entries = [*fields, *others]
    start = 8 + 2 + 12 * len(entries) + 4
    packed = b"".join(struct.pack("<HHII", tag, kind, 1, start if value < 0 else value) for tag, kind, value in entries)
    return b"II*\0" + struct.pack("<IH", 8, len(entries)) + packed + bytes(4) + data


@each(
    ("suffix", "content"),
    [
        (".tif", tiff([(256, 3, 100), (256, 4, 60_000), (257, 4, 60_000)])),  # a width that stands twice
        (".tif", tiff([(256, 4, 60_000), (256, 3, 100), (257, 4, 60_000)])),
        (".tif", tiff([(256, 16, 60_000), (257, 4, 60_000)])),  # of a type that has eight bytes
        (".pgm", b"P4\n#x\r60000 60000\n5 5\n" + bytes(1000)),  # a comment that ends at a carriage return
        (".pgm", b"P4\n#x\r5 5\n60000 60000\n" + bytes(1000)),
    ],
)
def test_no_more_pixels_are_decoded_than_were_counted(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(content)
    try:
        read = read_values(path)
    except ValueError as error:
        assert "a" + suffix + ": expected at most 50 million pixels" in str(error)
    else:
        assert read is None or read[0].size < 50_000_000


def test_a_palette_is_the_files_own(tmp_path: Path) -> None:
    image = images.Image.fromarray(np.eye(9, dtype=np.uint8), "P")
    image.putpalette([0, 0, 0, 200, 0, 0])
    note = PngInfo()
    note.add_text("a", "PLTE")  # which stands before the palette
    image.save(tmp_path / "a.png", pnginfo=note)
    np.testing.assert_array_equal(read_masks(tmp_path, (None, None)).silhouette(0).mask, np.eye(9, dtype=bool))


def test_masks_that_unpack_to_too_much_are_refused_by_their_shape(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stack = np.zeros((4, 20, 30), dtype=np.uint8)
    stack[:, 5:9] = 255
    folder = tmp_path / "masks"
    folder.mkdir()
    for k, frame in enumerate(stack):
        assert cv2.imwrite(str(folder / f"{k}.png"), frame)
    np.save(tmp_path / "a.npy", stack)
    np.savez_compressed(tmp_path / "a.npz", masks=stack)
    for path in (folder, tmp_path / "a.npz", tmp_path / "a.npy"):
        monkeypatch.setenv("POSEFIT_DECODED_GIGABYTES", f"{stack.nbytes / 1e9 - 1e-9:.9f}")
        with pytest.raises(ValueError, match=f"{path.name}: expected masks that unpack to at most .* GB, got "):
            read_masks(path, (None, None))
        monkeypatch.setenv("POSEFIT_DECODED_GIGABYTES", f"{stack.nbytes / 1e9:.9f}")
        assert len(read_masks(path, (None, None))) == 4
    monkeypatch.setenv("POSEFIT_DECODED_GIGABYTES", "lots")
    with pytest.raises(ValueError, match="POSEFIT_DECODED_GIGABYTES must be a number, got 'lots'"):
        read_masks(folder, (None, None))
    with pytest.raises(ValueError, match="masks: expected at most 50 million pixels a frame, got 10000x6000"):
        read_masks(np.broadcast_to(np.False_, (1, 6_000, 10_000)), (None, None))


def test_masks_are_kept_as_bits_and_chosen_frames_alone(tmp_path: Path) -> None:
    drawn = np.random.default_rng(0).random((9, 31, 45)) < 0.5
    for stack in (drawn, drawn * 255.0, np.asfortranarray(drawn.astype(np.uint8))):
        np.savez_compressed(tmp_path / "a.npz", masks=stack, valid=drawn)
        packed = read_masks(tmp_path / "a.npz", (2, 7))
        assert packed.masks.nbytes == 5 * -(-31 * 45 // 8)
        for k in range(5):
            np.testing.assert_array_equal(packed.silhouette(k).mask, drawn[2 + k])
            np.testing.assert_array_equal(packed.silhouette(k).valid, drawn[2 + k])
        assert packed.names[0].endswith("a.npz[2]")
