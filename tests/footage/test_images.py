"""Images that may be hostile: their size is known before they are decoded."""

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from posefit.footage import images
from posefit.footage.images import read_image, size_of
from posefit.footage.readers import read_masks


def test_the_size_that_is_stated_is_the_size_that_comes(tmp_path: Path) -> None:
    drawn = np.random.default_rng(0).integers(0, 255, (37, 53, 3), dtype=np.uint8)
    for image, suffixes in ((drawn, "png jpg bmp tif ppm"), (drawn[..., 0], "png jpg bmp tif pgm")):
        for suffix in suffixes.split():
            path = tmp_path / f"a.{suffix}"
            assert cv2.imwrite(str(path), image)
            assert size_of(path.read_bytes()) == (53, 37)
            for grey, flag in ((True, cv2.IMREAD_GRAYSCALE), (False, cv2.IMREAD_COLOR)):
                np.testing.assert_array_equal(read_image(path, grey=grey), cv2.imread(str(path), flag))


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
    monkeypatch.setattr(cv2, "imdecode", None)
    for side, came in ((8_000, "8000x8000"), (12_000, "12000x12000"), (30_000, "far more")):
        bomb(tmp_path / "a.png", side)
        with pytest.raises(ValueError, match=f"a.png: expected at most 50 million pixels, got {came}"):
            read_masks(tmp_path, (None, None))


def test_a_picture_that_opencv_refuses_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bomb(tmp_path / "a.png", 2**20 + 1)  # wider than OpenCV reads, where it raises
    monkeypatch.setattr(images, "PIXELS", 2**60)
    monkeypatch.setattr(images.Image, "MAX_IMAGE_PIXELS", None)
    with pytest.raises(
        ValueError, match=r"a.png: expected an image \(PNG, JPEG, BMP, TIFF or PGM\), got a file that is none"
    ):
        read_masks(tmp_path, (None, None))


def test_a_chunk_that_says_it_has_more_than_the_file_is_not_made_room_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bomb(tmp_path / "a.png", 30)
    content = (tmp_path / "a.png").read_bytes()
    (tmp_path / "a.png").write_bytes(content[:33] + b"\x7f" + content[34:])  # OpenCV took 2 GB for it
    monkeypatch.setattr(cv2, "imdecode", None)
    assert read_image(tmp_path / "a.png", grey=True) is None


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
