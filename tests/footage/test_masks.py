"""Masks from elsewhere: what their values mean and which person is followed; images that may be hostile."""

import json
import pickle
import struct
import zlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL.PngImagePlugin import PngInfo

from posefit.footage import images
from posefit.footage.cameras import combined
from posefit.footage.cleaning import cleaned
from posefit.footage.images import read_image, read_marks
from posefit.footage.kinds import resolve
from posefit.footage.numbering import Images
from posefit.footage.options import SourceOptions, text_person
from posefit.footage.source import FilmedBody, scene_of
from posefit.footage.views import View, empty_planes, full_planes, release
from tests.cases import each
from tests.commands import error_of, run
from tests.footage.conftest import ALL, NOBODY, SIZE, camera, read_masks, stack

QUICK = [
    "--method",
    "@loose",
    "--evaluations",
    "200",
    "--restarts",
    "1",
    "--body-frames",
    "0",
    "--view-degrees",
    "90",
]


def folder(path: Path, images: Sequence[Any], suffix: str = ".png") -> Path:
    path.mkdir()
    for k, image in enumerate(images):
        assert cv2.imwrite(str(path / f"{k:04d}{suffix}"), image)
    return path


def read(path: Path, label: int | None = None) -> tuple[View, list[str]]:
    view = cleaned(read_masks(path, ALL, label), holes=0.0)
    return view, list(view.warnings)


def check(
    path: Path, wanted: Sequence[Any], label: int | None = None
) -> tuple[View, list[str]]:
    masks, warnings = read(path, label)
    assert len(masks) == len(wanted)
    for k, mask in enumerate(wanted):
        np.testing.assert_array_equal(masks.silhouette(k).mask, mask)
    return masks, warnings


def indexed(
    path: Path, numbers: Any, colours: Sequence[tuple[int, int, int]], **how: Any
) -> None:
    """Write a PNG with a palette, as tools for annotation do; OpenCV writes none."""
    image = images.Image.frombytes(
        "P", numbers.shape[::-1], numbers.astype(np.uint8).tobytes()
    )
    image.putpalette([value for colour in colours for value in colour])
    image.save(path, **how)


@each("kind", [np.uint8, np.uint16])
@each("values", [(0, 1), (0, 255), (0, 38), (64, 192)])
def test_any_two_values_are_a_mask(
    walk: list[Any], tmp_path: Path, kind: Any, values: tuple[int, int]
) -> None:
    images = [np.where(mask, values[1], values[0]).astype(kind) for mask in walk]
    assert check(folder(tmp_path / "a", images), walk)[1] == []
    check(stack(tmp_path / "a.npz", images), walk)


def softened(mask: Any) -> Any:
    """Return a mask as a network gives it: degrees from 0 to 1."""
    return cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.5) * 0.97


@each(
    ("kind", "full"),
    [(np.uint8, 255), (np.uint16, 65_535), (np.float32, 1.0), (np.float64, 255)],
)
def test_soft_masks_are_cut_half_way(
    walk: list[Any], tmp_path: Path, kind: Any, full: float
) -> None:
    soft = [(softened(mask) * full).astype(kind) for mask in walk]
    # no person for the network; the frame's own scale would show one
    soft[2] = (soft[2] * 0.3).astype(kind)
    wanted = [mask > (full // 2 if full > 1 else 0.5) for mask in soft]
    assert not check(stack(tmp_path / "a.npz", soft), wanted)[0].usable[2]
    if np.issubdtype(kind, np.integer):
        check(folder(tmp_path / "a", soft), wanted)


def test_the_alpha_of_a_person_cut_out_is_the_mask(
    walk: list[Any], tmp_path: Path
) -> None:
    rng = np.random.default_rng(0)
    cut = [
        np.dstack(
            [rng.integers(0, 255, (*mask.shape, 3)), 255 * softened(mask)]
        ).astype(np.uint8)
        for mask in walk
    ]
    assert (
        check(folder(tmp_path / "a", cut), [one[..., 3] > 127 for one in cut])[1] == []
    )
    opaque = [
        np.dstack([*[255 * mask] * 3, np.full(mask.shape, 255)]).astype(np.uint8)
        for mask in walk
    ]
    check(folder(tmp_path / "b", opaque), walk)


PALETTE = [(0, 0, 0), (128, 0, 0), (0, 128, 0), (128, 128, 0)]


def labelled(walk: list[Any]) -> list[Any]:
    """Return label images: the floor is 1, the person 2, a bag 3."""
    images = []
    for mask in walk:
        numbers = np.zeros(mask.shape, dtype=np.uint8)
        numbers[-12:] = 1
        numbers[30:44, 4:18] = 3
        numbers[mask] = 2
        images.append(numbers)
    return images


@each("kind", ["palette", "grey", "colours", "npz"])
def test_one_of_several_labels_is_chosen(
    walk: list[Any], tmp_path: Path, kind: str
) -> None:
    images = labelled(walk)
    path = tmp_path / "masks"
    label = 2
    if kind == "palette":
        path.mkdir()
        for k, numbers in enumerate(images):
            indexed(path / f"{k}.png", numbers, PALETTE)
    elif kind == "grey":
        folder(path, images)
    elif kind == "colours":
        label = 0x008000
        folder(
            path,
            [
                np.array(PALETTE, dtype=np.uint8)[numbers][..., ::-1]
                for numbers in images
            ],
        )
    else:
        path = stack(tmp_path / "masks.npz", np.stack(images).astype(np.int32))
    check(path, walk, label)
    names = "0x800000, 0x008000, 0x808000" if kind == "colours" else "1, 2, 3"
    error = error_of("track", path, "--out", tmp_path / "out", *QUICK)
    assert "expected masks of one person, got the labels " in error
    assert "; --label N chooses one" in error
    assert all(name in error for name in names.split(", "))
    error = error_of("track", path, "--out", tmp_path / "out", "--label", "9", *QUICK)
    assert "label must be one of " in error
    assert error.endswith(", got 9")
    assert not (tmp_path / "out").exists()
    assert (
        run(
            "track", path, "--out", tmp_path / "out", "--label", hex(label), *QUICK
        ).exit_code
        == 0
    )


def test_a_palette_of_one_colour_and_one_of_greys_need_no_label(
    walk: list[Any], tmp_path: Path
) -> None:
    for name, colours, value in (
        ("one", PALETTE, 1),
        ("grey", [(k, k, k) for k in range(256)], 255),
    ):
        (tmp_path / name).mkdir()
        for k, mask in enumerate(walk):
            indexed(tmp_path / name / f"{k}.png", np.where(mask, value, 0), colours)
        check(tmp_path / name, walk)


def test_an_edge_between_two_values_is_no_label(
    walk: list[Any], tmp_path: Path
) -> None:
    images = [np.where(mask, 255, 0).astype(np.uint8) for mask in walk]
    large = [cv2.resize(one, (480, 360), interpolation=0) for one in images]
    smooth = [cv2.resize(one, SIZE, interpolation=cv2.INTER_AREA) for one in large]
    smooth[0][5, 5] = 90
    check(folder(tmp_path / "a", smooth), [one > 127 for one in smooth])


@each(
    ("words", "message"),
    [
        (
            ["MASKS", "--label", "person"],
            "expected a whole number such as 15, or a colour 0xRRGGBB, got 'person'",
        ),
        (
            ["MASKS", "--holes", "2"],
            "holes must lie in 0 to 1, a share of the person's area, got 2.0",
        ),
        (
            ["walk", "--label", "1"],
            "label applies only to masks, got 1 for a motion",
        ),
        (
            ["SOFT", "--label", "1"],
            "label must be left out for soft masks, got 1: only PNG files and whole numbers have labels",
        ),
        (
            ["PHOTOS"],
            "photos: expected masks, got pictures in many colours: make masks of the person, or cut them out with an alpha channel",
        ),
        (["PICTURES"], "pictures: expected masks, got pictures in many colours"),
        (
            ["EMPTY"],
            "empty: expected a mask with a person and a background, got an empty one first, and none with both in",
        ),
        (["SIZES"], "0001.png: mask must have shape (120, 160), got (60, 80)"),
    ],
)
def test_a_mistake_with_masks_leaves_one_line(
    walk: list[Any], tmp_path: Path, words: list[str], message: str
) -> None:
    inputs = tmp_path / "in"
    inputs.mkdir()
    images = [np.where(mask, 255, 0).astype(np.uint8) for mask in walk]
    photo = [
        np.random.default_rng(0).integers(0, 255, (*walk[0].shape, 3), dtype=np.uint8)
    ]
    folders = {
        "MASKS": folder(inputs / "masks", images),
        "SOFT": folder(inputs / "soft", images, ".jpg"),
        "PHOTOS": folder(inputs / "photos", photo, ".jpg"),
        "PICTURES": folder(inputs / "pictures", photo),
        "EMPTY": folder(inputs / "empty", [np.zeros_like(image) for image in images]),
        "SIZES": folder(
            inputs / "sizes", [images[0], images[1][::2, ::2], *images[2:]]
        ),
    }
    words = [str(folders.get(word, word)) for word in words]
    assert (
        message
        in run("track", *words, "--out", tmp_path / "out", *QUICK).stderr.splitlines()[
            -1
        ]
    )
    assert [path.name for path in tmp_path.iterdir()] == ["in"]


def test_numbers_in_names_count_as_numbers(walk: list[Any], tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.mkdir()
    for k in (2, 10, 1, 100):
        cv2.imwrite(
            str(path / f"mask{k}.png"), np.where(walk[0], 255, 0).astype(np.uint8)
        )
    (path / "._mask1.png").write_bytes(b"what a Mac puts beside it")
    (images,) = resolve(path).materials
    assert isinstance(images, Images)
    assert [file.name for file in images.files] == [
        f"mask{k}.png" for k in (1, 2, 10, 100)
    ]


def test_inverted_masks_are_turned_round_with_a_warning(
    walk: list[Any], tmp_path: Path
) -> None:
    path = stack(tmp_path / "a.npz", [~mask for mask in walk])
    (warning,) = check(path, walk)[1]
    assert (
        warning
        == f"{path}: the masks cover most of the picture's border, so they seem to be inverted, and are inverted back"
    )


def test_a_person_who_fills_a_side_is_not_inverted(tmp_path: Path) -> None:
    near = np.zeros((120, 160), dtype=bool)
    near[10:, 30:130] = True  # on the lower border, for most of it
    assert check(stack(tmp_path / "a.npz", [near] * 3), [near] * 3)[1] == []


def test_empty_and_full_masks_are_held_and_counted(
    walk: list[Any], tmp_path: Path
) -> None:
    masks = [NOBODY, walk[1], walk[2], NOBODY, ~NOBODY, walk[5]]
    path = folder(tmp_path / "a", [255 * mask.astype(np.uint8) for mask in masks])
    packed, _ = check(path, masks)
    assert packed.usable.tolist() == [False, True, True, False, False, True]
    result = run("track", path, "--out", tmp_path / "out", *QUICK)
    assert result.exit_code == 0, result.stderr
    assert (
        json.loads((tmp_path / "out" / "summary.json").read_text())["held_frames"] == 3
    )


def blob(*middles: tuple[int, int], wide: int = 16, tall: int = 60) -> Any:
    mask = np.zeros((120, 200), dtype=bool)
    for x, y in middles:
        mask[
            max(0, y - tall // 2) : y + tall // 2, max(0, x - wide // 2) : x + wide // 2
        ] = True
    return mask


def test_a_frame_that_the_edge_leaves_little_of_is_not_usable(tmp_path: Path) -> None:
    masks = np.zeros((5, 40, 60), dtype=bool)
    # ten columns wide: 10, 10, 8, 5 and 3 of them in the picture
    for k, left in enumerate((30, 40, 52, 55, 57)):
        masks[k, 10:34, left : left + 10] = True
    read_, _ = read(folder(tmp_path / "out", 255 * masks.astype(np.uint8)))
    assert read_.usable.tolist() == [True, True, True, True, False]
    # cut by the lower edge in all of them
    bust = np.pad(masks[:, 10:34], ((0, 0), (16, 0), (0, 0)))
    read_, _ = read(folder(tmp_path / "bust", 255 * bust.astype(np.uint8)))
    assert read_.usable.all()


def test_the_person_nearest_to_the_last_position_is_followed(
    tmp_path: Path,
) -> None:
    walker = [(40 + 4 * k, 60) for k in range(25)]
    stander = (100, 58)
    # they touch for a while
    masks = [blob(place, tall=64) | blob(stander) for place in walker]
    followed, (warning,) = read(stack(tmp_path / "a.npz", masks))
    for k in (*range(10), *range(20, 25)):
        np.testing.assert_array_equal(
            followed.silhouette(k).mask, blob(walker[k], tall=64), err_msg=str(k)
        )
    places = "1 at 40,60 in frame 0; 2 at 100,58 in frame 0"
    assert warning.endswith(
        f": 2 people: {places}; person 1 is followed, --person N another"
    )
    first = followed.silhouette(0)
    assert not first.valid[blob(stander)].any()  # the other's pixels are unknown
    assert first.valid[~blob(stander)].all()
    hidden = followed.silhouette(15)  # they are one blob
    np.testing.assert_array_equal(hidden.valid, hidden.mask | ~masks[15])


@each(
    ("words", "followed"),
    [
        ((), (180, 60)),
        (("2",), (40, 60)),
        (("38,70",), (40, 60)),
        (("170,60",), (180, 60)),
    ],
)
def test_the_longest_visible_or_the_chosen_person_is_followed(
    words: Sequence[str], followed: tuple[int, int], tmp_path: Path
) -> None:
    masks = [blob((40, 60), tall=64) | blob((180, 60))] * 3 + [blob((180, 60))] * 2
    path = stack(tmp_path / "a.npz", masks)
    choice = text_person(*words) if words else None
    clean = cleaned(read_masks(path, ALL), choice=choice)
    np.testing.assert_array_equal(
        clean.silhouette(0).mask, blob(followed, tall=64 if followed[0] == 40 else 60)
    )
    assert clean.usable.tolist() == [True] * 3 + [followed[0] == 180] * 2


def test_an_unknown_person_number_is_reported_in_one_line(tmp_path: Path) -> None:
    masks = [blob((40, 60)) | blob((180, 60))] * 4
    path = stack(tmp_path / "a.npz", masks)
    error = error_of("track", path, "--person", "3", *QUICK)
    assert "person must be 1 to 2, the number of people, got 3" in error
    assert "person applies only to footage" in error_of(
        "track", "walk", "--person", "2"
    )
    for text in ("left", "1,2,3"):
        words = f"expected a number such as 2, or X,Y in pixels, got '{text}'"
        assert words in error_of("track", path, "--person", text)


def test_a_person_in_pieces_is_one_and_specks_are_none(tmp_path: Path) -> None:
    tree = blob((60, 60))
    table = blob((60, 60))
    tree[:, 59:61] = False
    table[50:62] = False
    speck = blob((60, 60)) | blob((150, 30), wide=6, tall=6)
    for k, mask in enumerate((tree, table, speck)):
        assert check(stack(tmp_path / f"{k}.npz", [mask] * 3), [mask] * 3)[1] == []
    known = np.ones_like(tree)
    hidden = blob((60, 60), wide=60)
    known[:, 45:75] = False
    check(
        stack(tmp_path / "b.npz", [hidden & known] * 3, valid=[known] * 3),
        [hidden & known] * 3,
    )


def test_small_holes_are_filled_by_default(tmp_path: Path) -> None:
    mask = blob((60, 60), wide=40)
    holed = mask.copy()
    holed[50:53, 50:53] = False
    holed[60:75, 55:65] = False  # between an arm and the body
    path = stack(tmp_path / "a.npz", [holed] * 2)

    def filled(holes: float | None) -> Any:
        return cleaned(read_masks(path, ALL), holes).silhouette(0).mask

    assert filled(None)[51, 51]
    assert not filled(None)[65, 60]
    np.testing.assert_array_equal(filled(0.0), holed)
    np.testing.assert_array_equal(filled(1.0), mask)


def test_views_of_other_frames_or_another_rate_are_refused_by_name(
    walk: list[Any], tmp_path: Path
) -> None:
    cameras = [camera(np.pi / 2), camera(0.6)]
    files = (("a", 6, 30.0), ("b", 4, 30.0), ("c", 6, 60.0))
    a, b, c = (
        stack(tmp_path / f"{name}.npz", walk[:count], fps=fps)
        for name, count, fps in files
    )
    with pytest.raises(
        ValueError, match=rf"views must have the same frames, got 6 of {a} and 4 of {b}"
    ):
        scene_of([a, b], SourceOptions(camera=cameras))
    with pytest.raises(
        ValueError,
        match=rf"views must have the same frame rate, got 30 Hz of {a} and 60 Hz of {c}",
    ):
        scene_of([a, c], SourceOptions(camera=cameras))


def test_views_of_videos_end_with_the_shortest(walk: list[Any], tmp_path: Path) -> None:
    views = []
    for name, count in (("a", 6), ("b", 4)):
        masks, _ = read(stack(tmp_path / f"{name}.npz", walk[:count]))
        views.append(replace(masks, name=f"{name}.mp4", filmed=SIZE))
    scene = combined(
        views,
        FilmedBody.of(SourceOptions()).body,
        [camera(np.pi / 2), camera(np.pi / 2)],
        SourceOptions(),
    )
    assert len(scene.observations) == 4
    assert scene.warnings == [
        "the videos differ in length; the first 4 frames are used of a.mp4 6, b.mp4 4"
    ]


def test_masks_beyond_the_memory_are_refused(
    walk: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = stack(tmp_path / "a.npz", walk)
    monkeypatch.setattr(
        "posefit.footage.views.allowed_bytes", lambda: 6 * SIZE[0] * SIZE[1] // 8 - 1
    )
    with pytest.raises(
        ValueError,
        match="the masks must fit in .* GB of memory, got 6 frames of 160x120 pixels",
    ):
        read(path)


def chunk(kind: bytes, content: bytes) -> bytes:
    """Return a part of a PNG file."""
    return (
        struct.pack(">I", len(content))
        + kind
        + content
        + struct.pack(">I", zlib.crc32(kind + content))
    )


def bomb(path: Path, side: int) -> None:
    """Write a PNG file whose header states a size and whose pixels are not there."""
    head = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    parts = (
        chunk(b"IHDR", head),
        chunk(b"IDAT", zlib.compress(bytes(100))),
        chunk(b"IEND", b""),
    )
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))


def test_a_picture_of_too_many_pixels_is_never_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(images.Image.Image, "convert", None)
    for side, came in (
        (8_000, "8000x8000"),
        (12_000, "12000x12000"),
        (30_000, "far more"),
    ):
        bomb(tmp_path / "a.png", side)
        with pytest.raises(
            ValueError, match=f"a.png: expected at most 50 million pixels, got {came}"
        ):
            read_masks(tmp_path, ALL)


def test_a_chunk_that_says_it_has_more_than_the_file_is_refused(tmp_path: Path) -> None:
    bomb(tmp_path / "a.png", 30)
    content = (tmp_path / "a.png").read_bytes()
    (tmp_path / "a.png").write_bytes(content[:33] + b"\x7f" + content[34:])
    assert read_image(tmp_path / "a.png", grey=True) is None


def tiff(fields: Sequence[tuple[int, int, int]]) -> bytes:
    """Return a TIFF file of 8 bits a pixel, all 0, that has these fields (tag, type, value) for its size."""
    data = zlib.compress(bytes(10_000))
    others = [
        (258, 3, 8),
        (259, 3, 8),
        (262, 3, 1),
        (273, 4, -1),
        (277, 3, 1),
        (278, 4, 60_000),
        (279, 4, len(data)),
    ]
    entries = [*fields, *others]
    start = 8 + 2 + 12 * len(entries) + 4
    packed = b"".join(
        struct.pack("<HHII", tag, kind, 1, start if value < 0 else value)
        for tag, kind, value in entries
    )
    return b"II*\0" + struct.pack("<IH", 8, len(entries)) + packed + bytes(4) + data


@each(
    ("suffix", "content"),
    [
        # a width that stands twice
        (".tif", tiff([(256, 3, 100), (256, 4, 60_000), (257, 4, 60_000)])),
        (".tif", tiff([(256, 4, 60_000), (256, 3, 100), (257, 4, 60_000)])),
        # of a type that has eight bytes
        (".tif", tiff([(256, 16, 60_000), (257, 4, 60_000)])),
        # a comment that ends at a carriage return
        (".pgm", b"P4\n#x\r60000 60000\n5 5\n" + bytes(1000)),
        (".pgm", b"P4\n#x\r5 5\n60000 60000\n" + bytes(1000)),
    ],
)
def test_no_more_pixels_are_decoded_than_were_counted(
    tmp_path: Path, suffix: str, content: bytes
) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(content)
    try:
        read = next(read_marks(path), None)
    except ValueError as error:
        assert "a" + suffix + ": expected at most 50 million pixels" in str(error)
    else:
        assert read is None or read.values.size < 50_000_000


def test_a_palette_is_the_files_own(tmp_path: Path) -> None:
    note = PngInfo()
    note.add_text("a", "PLTE")  # which stands before the palette
    indexed(tmp_path / "a.png", np.eye(9), [(0, 0, 0), (200, 0, 0)], pnginfo=note)
    np.testing.assert_array_equal(
        read_masks(tmp_path, ALL).silhouette(0).mask, np.eye(9, dtype=bool)
    )


def test_masks_that_unpack_to_too_much_are_refused_by_shape(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    masks = np.zeros((4, 20, 30), dtype=np.uint8)
    masks[:, 5:9] = 255
    pictures = folder(tmp_path / "masks", masks)
    np.save(tmp_path / "a.npy", masks)
    np.savez_compressed(tmp_path / "a.npz", masks=masks)
    for path in (pictures, tmp_path / "a.npz", tmp_path / "a.npy"):
        monkeypatch.setenv(
            "POSEFIT_DECODED_GIGABYTES", f"{masks.nbytes / 1e9 - 1e-9:.9f}"
        )
        with pytest.raises(
            ValueError,
            match=f"{path.name}: expected masks that unpack to at most .* GB, got ",
        ):
            read_masks(path, ALL)
        monkeypatch.setenv("POSEFIT_DECODED_GIGABYTES", f"{masks.nbytes / 1e9:.9f}")
        assert len(read_masks(path, ALL)) == 4
    monkeypatch.setenv("POSEFIT_DECODED_GIGABYTES", "lots")
    with pytest.raises(
        ValueError, match="POSEFIT_DECODED_GIGABYTES must be a number, got 'lots'"
    ):
        read_masks(pictures, ALL)
    with pytest.raises(
        ValueError,
        match="masks: expected at most 50 million pixels a frame, got 10000x6000",
    ):
        read_masks(np.broadcast_to(np.False_, (1, 6_000, 10_000)), ALL)


def transparent(path: Path, numbers: Sequence[Any], alpha: int = 255) -> Path:
    """Write labels in the colours of a palette, 0 transparent and the others of an alpha."""
    path.mkdir()
    for k, image in enumerate(numbers):
        colours = np.array(PALETTE, dtype=np.uint8)[image]
        shown = np.where(image > 0, alpha, 0).astype(np.uint8)[..., None]
        file = str(path / f"{k}.png")
        assert cv2.imwrite(file, np.concatenate([colours[..., ::-1], shown], axis=2))
    return path


@each("kind", ["palette", "colours", "translucent"])
def test_labels_before_a_transparent_background_are_labels(
    walk: list[Any], tmp_path: Path, kind: str
) -> None:
    several = labelled(walk)
    one = [np.where(image == 2, 2, 0) for image in several]
    for name, written in (("several", several), ("one", one)):
        path = tmp_path / name
        if kind == "palette":
            path.mkdir()
            for k, numbers in enumerate(written):
                indexed(path / f"{k}.png", numbers, PALETTE, transparency=0)
        else:
            transparent(path, written, 255 if kind == "colours" else 90)
        if name == "one":
            check(path, walk)
        else:
            with pytest.raises(ValueError, match="got the labels .*--label N chooses"):
                read_masks(path, ALL)
    label = 2 if kind == "palette" else 0x008000
    check(tmp_path / "several", walk, label)


@each("kind", ["palette", "alpha", "black"])
def test_flat_levels_of_transparency_are_labels(
    walk: list[Any], tmp_path: Path, kind: str
) -> None:
    path = tmp_path / "a"
    path.mkdir()
    for k, numbers in enumerate(labelled(walk)):
        file = path / f"{k}.png"
        if kind == "palette":  # an alpha for each of its colours
            steps = bytes(range(0, 250, 250 // len(PALETTE)))
            indexed(file, numbers, PALETTE, transparency=steps)
        elif kind == "black":  # a palette that was never set
            indexed(file, numbers, [(0, 0, 0)] * len(PALETTE))
        else:
            colours = np.full((*numbers.shape, 4), 90, dtype=np.uint8)
            colours[..., 3] = 60 * numbers
            assert cv2.imwrite(str(file), colours)
    what = "levels of transparency" if kind == "alpha" else "labels"
    with pytest.raises(ValueError, match=f"got the {what} .*--label N chooses"):
        read_masks(path, ALL)
    if kind != "alpha":
        check(path, walk, 2)


@each("alpha", [40, 89, 127, 128, 153, 254])
def test_a_translucent_colour_is_the_person(
    walk: list[Any], tmp_path: Path, alpha: int
) -> None:
    colour = (30, 144, 255)
    sharp = [
        np.dstack([*(np.full(mask.shape, c) for c in colour), alpha * mask])
        for mask in walk
    ]
    check(folder(tmp_path / "sharp", [image.astype(np.uint8) for image in sharp]), walk)
    # with an edge that is softer still
    soft = [
        np.dstack([image[..., :3], softened(mask) * alpha]).astype(np.uint8)
        for image, mask in zip(sharp, walk, strict=True)
    ]
    highest = max(int(image[..., 3].max()) for image in soft)
    half = highest // 2 if highest <= 127 else 127
    wanted = [image[..., 3] > half for image in soft]
    check(folder(tmp_path / "soft", soft), wanted)


@each("kind", [np.uint8, np.uint16, np.int32])
@each("count", [20, 70, 200])
def test_a_label_is_required_for_any_number_of_labels(
    walk: list[Any], tmp_path: Path, kind: Any, count: int
) -> None:
    images = []
    for mask in walk:
        # squares of a label each, as a panoptic map has them
        rows, columns = np.indices(mask.shape) // 8
        numbers = 1 + (rows * (mask.shape[1] // 8) + columns) % count
        numbers[mask] = 250
        images.append(numbers.astype(kind))
    path = stack(tmp_path / "a.npz", images)
    with pytest.raises(ValueError, match="got the labels .*--label N chooses one"):
        read_masks(path, ALL)
    check(path, walk, 250)


def test_degrees_of_many_values_are_no_labels(walk: list[Any], tmp_path: Path) -> None:
    for full, kind in ((255, np.uint8), (255, np.int32), (1000, np.int32)):
        soft = [(softened(mask) * full).astype(kind) for mask in walk]
        masks = read_masks(stack(tmp_path / "a.npz", soft), ALL)
        assert "are confidences" in masks.guesses[0]


@each("label", [1, 15])
@each("wide", [1, 3])
def test_a_void_border_is_not_the_person(
    walk: list[Any], tmp_path: Path, label: int, wide: int
) -> None:
    # 255 around each object, as PASCAL VOC has it
    images = []
    for mask in walk:
        grown = cv2.dilate(mask.astype(np.uint8), np.ones((3, 3)), iterations=wide)
        image = np.where(grown > 0, 255, 0).astype(np.uint8)
        image[mask] = label
        images.append(image)
    path = stack(tmp_path / "a.npz", images)
    if wide > 1:  # it may be a thing as well
        with pytest.raises(ValueError, match="got the labels .*--label N chooses one"):
            read_masks(path, ALL)
    check(path, walk, label if wide > 1 else None)


@each(
    ("lowest", "highest"),
    [
        *((-3.0, 20.0), (-20.0, 3.0), (-8.0, 60.0), (-40.0, 70.0)),
        # less below 0 than resampling explains, but in the whole background
        *((-2.0, 25.0), (-1.0, 30.0)),
    ],
)
def test_logits_are_cut_at_zero_however_high_they_go(
    walk: list[Any], tmp_path: Path, lowest: float, highest: float
) -> None:
    soft = np.array([cv2.GaussianBlur(m.astype(np.float32), (0, 0), 1.5) for m in walk])
    logits = lowest + (highest - lowest) * soft
    np.save(tmp_path / "a.npy", logits)
    check(tmp_path / "a.npy", list(logits > 0.0))


def test_masks_of_a_long_film_are_the_same_in_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    masks = np.zeros((5, 20, 30), dtype=bool)
    masks[:, 5:15, 10:18] = True
    masks[2, :4] = True
    np.save(tmp_path / "a.npy", masks)
    short = read_masks(tmp_path / "a.npy", ALL)
    monkeypatch.setattr("posefit.footage.views.PLANES_BYTES", 0)
    long = read_masks(tmp_path / "a.npy", ALL)
    assert isinstance(long.bits, np.memmap)
    np.testing.assert_array_equal(long.bits, short.bits)
    np.testing.assert_array_equal(long.usable, short.usable)
    again = pickle.loads(pickle.dumps(long))
    np.testing.assert_array_equal(again.bits, short.bits)


def test_released_frames_of_a_file_keep_what_was_written(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("posefit.footage.views.PLANES_BYTES", 0)
    size = (200, 120)  # not of whole pages
    planes = empty_planes(100, size)
    rows = np.random.default_rng(0).integers(0, 256, planes.shape, dtype=np.uint8)
    for k in range(100):
        planes[k] = rows[k]
        release(planes, k)
    np.testing.assert_array_equal(planes, rows)
    # the end of a file, a piece beyond it, and a slice
    release(planes, 99)
    release(planes, 90, 500)
    release(planes[60:], 10, 20)
    np.testing.assert_array_equal(planes, rows)
    in_memory = rows.copy()
    release(in_memory, 5)
    np.testing.assert_array_equal(in_memory, rows)


def test_frames_whose_pixels_are_all_known_share_them() -> None:
    size = (10, 6)
    planes = full_planes(3, size)
    known = planes.copy()
    known[1, 0] = 0
    view = View(
        "film",
        np.arange(3),
        np.arange(3) / 30.0,
        planes,
        known,
        np.ones(3, dtype=bool),
        size,
    )
    first, second, third = (view.silhouette(k) for k in range(3))
    assert first.valid is third.valid
    assert first.valid.all()
    assert not second.valid[0, :8].any()
    assert second.valid.sum() == 52
