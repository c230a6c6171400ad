"""Masks by what their files and values are: pages, gaps in numbers, other pictures beside them, fractions and logits."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image

from posefit.errors import InputError
from posefit.footage.cleaning import cleaned
from posefit.footage.kinds import resolve
from posefit.footage.named import sources_of
from posefit.footage.numbering import numbered
from posefit.footage.options import SourceOptions
from posefit.footage.source import scene_of
from posefit.progress import Progress
from tests.cases import each
from tests.footage.conftest import ALL, read_masks


def drawn(walk: list[Any], value: int = 255) -> list[Any]:
    return [Image.fromarray(np.where(mask, value, 0).astype(np.uint8)) for mask in walk]


def read_by_pillow(path: Path) -> Any:
    with Image.open(path) as image:
        return np.asarray(image.convert("L")) > 127


def check(source: Any, walk: list[Any]) -> list[str]:
    masks = read_masks(source, ALL)
    assert len(masks) == len(walk)
    for k, mask in enumerate(walk):
        np.testing.assert_array_equal(masks.silhouette(k).mask, mask, err_msg=str(k))
    return list(masks.guesses)


@each("name", ["a.tif", "a.gif", "a.webp"])
def test_pages_of_a_file_are_frames(walk: list[Any], tmp_path: Path, name: str) -> None:
    first, *others = drawn(walk)
    options = {"lossless": True} if name == "a.webp" else {}
    first.save(tmp_path / name, save_all=True, append_images=others, **options)
    with Image.open(tmp_path / name) as image:
        assert image.n_frames == len(walk)
    check((tmp_path / name,), walk)
    check(tmp_path, walk)
    masks = read_masks((tmp_path / name,), (2, 4))
    assert masks.numbers.tolist() == [2, 3]
    np.testing.assert_array_equal(masks.silhouette(1).mask, walk[3])


@each("suffix", [".tif", ".gif"])
def test_several_files_of_pages_belong_to_several_cameras(
    walk: list[Any], tmp_path: Path, suffix: str
) -> None:
    first, *others = drawn(walk)
    films = [tmp_path / f"{name}{suffix}" for name in "ab"]
    for film in films:
        first.save(film, save_all=True, append_images=others)
    assert sources_of(films) == [(films[0],), (films[1],)]
    single = tmp_path / f"c{suffix}"
    first.save(single)
    with pytest.raises(InputError, match=f"got .*c{suffix} with one page"):
        sources_of([*films, single])


def test_one_number_written_in_two_ways_is_refused(
    walk: list[Any], tmp_path: Path
) -> None:
    for name, image in zip(("1", "01", "2"), drawn(walk), strict=False):
        image.save(tmp_path / f"{name}.png")
    with pytest.raises(InputError, match="one image a frame, got 01.png and 1.png"):
        read_masks(tmp_path, ALL)


@each("suffix", [".gif", ".webp", ".tif"])
def test_a_folder_of_images_of_any_kind_is_read_as_by_pillow(
    walk: list[Any], tmp_path: Path, suffix: str
) -> None:
    for k, image in enumerate(drawn(walk)):
        image.save(tmp_path / f"{k:03}{suffix}")
    wanted = [read_by_pillow(tmp_path / f"{k:03}{suffix}") for k in range(len(walk))]
    check(tmp_path, wanted)
    assert resolve(tmp_path).medium == "masks"


def test_an_animated_png_is_refused(walk: list[Any], tmp_path: Path) -> None:
    first, *others = drawn(walk)
    for count in (1, len(others)):
        later = others[:count]
        first.save(tmp_path / "a.png", save_all=True, append_images=later)
        with pytest.raises(
            ValueError, match="a.png: expected one picture, got an animation"
        ):
            read_masks(tmp_path, ALL)


def test_missing_numbers_are_unknown_frames(walk: list[Any], tmp_path: Path) -> None:
    for number, image in zip((7, 8, 10, 11, 14, 15), drawn(walk), strict=True):
        image.save(tmp_path / f"mask_{number}.png")
    masks = read_masks(tmp_path, ALL)
    assert masks.usable.tolist() == [
        True,
        True,
        False,
        True,
        True,
        False,
        False,
        True,
        True,
    ]
    assert [
        bool(masks.silhouette(k).valid.any()) for k in range(9)
    ] == masks.usable.tolist()
    np.testing.assert_array_equal(masks.silhouette(7).mask, walk[4])
    assert masks.guesses == [
        f"{tmp_path}: 3 of the frames 7 to 15 are missing, and the pose is held"
    ]
    assert len(read_masks(tmp_path, (3, 7))) == 4
    clean = cleaned(masks)
    assert (clean.usable.tolist(), clean.warnings) == (masks.usable.tolist(), [])
    messages: list[str] = []
    scene = scene_of([tmp_path], progress=Progress(messages.append))
    assert (scene.count, scene.observations[2].usable) == (9, False)
    assert f"guessed: {'; '.join(scene.guesses)}" in messages
    assert list(scene.guesses[:2]) == [*masks.guesses, "30 frames a second"]


@each(
    ("names", "count", "guess"),
    [
        (["f0.png", "f5.png", "f10.png"], 3, "the numbers of frames rise by 5"),
        (["f1.png", "f3.png", "f5.png"], 3, "the numbers of frames rise by 2"),
        (
            ["f0.png", "f5.png", "f15.png"],
            4,
            "1 of the frames 0 to 15 are missing, and the pose is held",
        ),
        (
            ["f3.png", "f1.png", "f2.png"],
            3,
            "the frames are in the listed order, not by their numbers",
        ),
        (
            ["f1.png", "f900001.png", "f900002.png"],
            3,
            "the numbers from 1 to 900002 do not count frames",
        ),
        (
            ["a-1-1.png", "a-1-2.png", "a-2-1.png"],
            3,
            "the frames are in the listed order, not by their numbers",
        ),
        (["a.png", "b.png"], 2, None),
        (["1.png", "2.png", "3.png"], 3, None),
        (["only9.png"], 1, None),
    ],
)
def test_the_meaning_of_numbers_in_names_is_reported(
    names: list[str], count: int, guess: str | None
) -> None:
    frames, guesses, *_ = numbered([Path(name) for name in names], "masks")
    assert len(frames) == count
    assert sum(frame is not None for frame in frames) == len(names)
    assert bool(guesses) == (guess is not None)
    assert guess is None or guess in guesses[-1] or guess in guesses[0]


@each(
    ("names", "message"),
    [
        (
            ["0.png", "0_rgb.jpg", "1.png", "1_rgb.jpg"],
            "expected images of one kind, got 2 .png and 2 .jpg",
        ),
        (
            ["m7.png", "m8.png", "m8.jpg"],
            "expected images of one kind, got 2 .png and 1 .jpg",
        ),
        (
            ["0.png", "0_grey.png", "1.png", "1_grey.png"],
            "expected one image a frame, got 0.png and 0_grey.png",
        ),
        (
            ["img_3.png", "img_4.png", "mask_3.png"],
            "expected one image a frame, got img_3.png and mask_3.png",
        ),
        (
            ["0.png", "1.png", "2.png", "preview.png"],
            "a number in the name of every image, got preview.png",
        ),
        # two objects in each frame, the second of which comes later
        (
            ["0_1.png", "1_1.png", "2_1.png", "2_2.png", "3_1.png", "3_2.png"],
            "expected one image a frame, got 2_1.png and 2_2.png",
        ),
        (
            [f"cam{k}_{frame:03d}.png" for k in (1, 2) for frame in range(3)],
            "expected one image a frame, got cam1_000.png and cam2_000.png",
        ),
        (
            [f"{frame:03d}_obj{k}.png" for frame in range(2) for k in range(9)],
            "expected one image a frame, got 000_obj0.png and 000_obj1.png",
        ),
    ],
)
def test_other_pictures_with_masks_are_refused(
    walk: list[Any], tmp_path: Path, names: list[str], message: str
) -> None:
    for name in names:
        drawn(walk)[0].save(tmp_path / name)
    with pytest.raises(ValueError, match=message):
        read_masks(tmp_path, ALL)


@each("suffix", [".png", ".jpg", ".webp"])
def test_images_that_are_to_be_turned_are_turned(
    walk: list[Any], tmp_path: Path, suffix: str
) -> None:
    turned = Image.Exif()
    turned[0x0112] = 6  # a quarter to the right
    options = {"lossless": True} if suffix == ".webp" else {}
    for k, mask in enumerate(walk):
        image = drawn([np.rot90(mask)])[0]
        image.save(tmp_path / f"{k}{suffix}", exif=turned, **options)
    view = read_masks(tmp_path, ALL)
    for k, mask in enumerate(walk):
        shown = view.silhouette(k).mask
        assert shown.shape == mask.shape
        assert (shown != mask).mean() < (1e-3 if suffix == ".jpg" else 1e-9)


def test_images_of_two_folders_are_not_one_camera(
    walk: list[Any], tmp_path: Path
) -> None:
    files = []
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        for k, image in enumerate(drawn(walk)):
            image.save(tmp_path / folder / f"f{k}.png")
            files.append(tmp_path / folder / f"f{k}.png")
    with pytest.raises(ValueError, match="f0.png; give the folder of each camera"):
        read_masks(files, ALL)
    # parts of one film, whose numbers go on
    part = [files[0], files[1], *files[len(walk) + 2 :]]
    assert len(read_masks(part, ALL)) == len(walk)


@each(
    "names",
    [
        # seconds and hundredths, or minutes, seconds and thousandths
        [f"{k // 25}.{4 * (k % 25):02d}.png" for k in range(100)],
        [f"{k // 1500}_{k // 25 % 60:02d}_{40 * (k % 25):03d}.png" for k in range(90)],
    ],
)
def test_times_in_names_are_one_image_a_frame(names: list[str]) -> None:
    assert numbered([Path(name) for name in names], "masks").files == [
        Path(name) for name in names
    ]


def test_a_photo_among_jpegs_is_refused_by_name(
    walk: list[Any], tmp_path: Path
) -> None:
    for k, image in enumerate(drawn(walk)):
        image.convert("RGB").save(tmp_path / f"{k}.jpg")
    check(tmp_path, [read_by_pillow(tmp_path / f"{k}.jpg") for k in range(len(walk))])
    colours = np.random.default_rng(0).integers(
        0, 255, (*walk[0].shape, 3), dtype=np.uint8
    )
    Image.fromarray(colours).save(tmp_path / "3.jpg")
    with pytest.raises(
        ValueError, match="3.jpg: expected masks, got pictures in many colours"
    ):
        read_masks(tmp_path, ALL)


@each("values", [(0.0, 0.3), (0.0, 2.0), (-3.0, 3.0), (0.0, 1.0), (-1.0, 0.0)])
def test_any_two_fractions_are_a_mask(
    walk: list[Any], tmp_path: Path, values: tuple[float, float]
) -> None:
    np.save(
        tmp_path / "a.npy",
        np.where(np.stack(walk), values[1], values[0]).astype(np.float32),
    )
    guesses = check(tmp_path / "a.npy", walk)
    usual = values == (0.0, 1.0)
    assert guesses == ([] if usual else [f"{tmp_path / 'a.npy'}: masks of values from {min(values):g} to {max(values):g}: the person is the higher of two"])  # fmt: skip


@pytest.mark.parametrize(
    ("frames", "used"),
    [
        ((6, 20), "frames 6:20 were chosen, and 6:8 are used: there are no others"),
        ((0, 9), "frames 0:9 were chosen, and 0:8 are used: there are no others"),
        ((6, 8), ""),
        ((-2, None), ""),
    ],
)
def test_chosen_frames_that_are_not_there_are_said(
    walk: list[Any], frames: tuple[int, int | None], used: str
) -> None:
    masks = np.array([*walk, *walk])[:8]
    scene = scene_of(masks, SourceOptions(frames=frames))
    assert [said for said in scene.warnings if "chosen" in said] == [used] * bool(used)
    motion = scene_of("walk", SourceOptions(frames=(40, 10_000)))
    assert motion.warnings[-1].startswith("frames 40:10000 were chosen, and 40:")


def test_labels_may_be_whole_numbers_held_as_fractions(
    walk: list[Any], tmp_path: Path
) -> None:
    labels = np.stack(walk).astype(np.float32)
    labels[:, :30, :30] = 2.0
    np.save(tmp_path / "a.npy", labels)
    with pytest.raises(ValueError, match="got the labels 1, 2; --label N chooses one"):
        read_masks(tmp_path / "a.npy", ALL)
    np.testing.assert_array_equal(
        read_masks(tmp_path / "a.npy", ALL, 1).silhouette(0).mask, walk[0]
    )


def test_logits_are_cut_at_zero_and_degrees_half_way(
    walk: list[Any], tmp_path: Path
) -> None:
    soft = np.stack(
        [cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.5) for mask in walk]
    )
    logits = 30.0 * soft - 20.0  # as SAM gives them
    np.save(tmp_path / "a.npy", logits)
    (guess,) = check(tmp_path / "a.npy", list(logits > 0.0))
    assert guess.endswith(
        "masks of values from -20 to 10 are logits: the person is above 0"
    )
    for scale, half in ((1.0, 0.5), (1.1, 0.5), (255.0, 127.0), (10.0, None)):
        # a little below 0, as bicubic scaling makes them
        degrees = soft * scale - 0.02 * scale
        threshold = half or 0.5 * float(degrees.max())
        np.save(tmp_path / "a.npy", degrees)
        (guess,) = check(tmp_path / "a.npy", list(degrees > threshold))
        assert guess.endswith(f"are confidences: the person is above {threshold:g}")


@each("kind", [np.uint8, np.int32, np.float32])
@each("most", [100.0, 80.0])
def test_percentages_are_cut_at_fifty(
    walk: list[Any], tmp_path: Path, kind: Any, most: float
) -> None:
    soft = [cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.5) for mask in walk]
    percentages = (most * np.stack(soft)).astype(kind)
    np.save(tmp_path / "a.npy", percentages)
    (guess,) = check(tmp_path / "a.npy", list(percentages > 50.0))
    assert guess.endswith("are percentages: the person is above 50")


def test_the_only_array_of_a_file_is_the_masks(walk: list[Any], tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", np.stack(walk))
    np.savez(tmp_path / "b.npz", silhouettes=np.stack(walk))
    for name in ("a.npz", "b.npz"):
        check(tmp_path / name, walk)
    np.savez(tmp_path / "c.npz", np.stack(walk), np.stack(walk))
    with pytest.raises(
        ValueError,
        match="c.npz: expected an .npz file with the key masks, got 'arr_0', 'arr_1'$",
    ):
        read_masks(tmp_path / "c.npz", ALL)


def test_a_person_who_touches_the_border_in_all_masks_is_followed(
    walk: list[Any], tmp_path: Path
) -> None:
    for k, mask in enumerate(walk):  # cut to the person, as silhouettes of gait are
        rows = np.flatnonzero(mask.any(axis=1))
        columns = np.flatnonzero(mask.any(axis=0))
        cut = 255 * mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].astype(
            np.uint8
        )
        large = cv2.resize(cut, (88, 128), interpolation=cv2.INTER_NEAREST)
        Image.fromarray(large).save(tmp_path / f"{k:03}.gif")
    scene = scene_of([tmp_path])
    assert [scene.observations[k].usable for k in range(len(walk))] == [True] * len(
        walk
    )


def test_an_image_of_numbers_that_are_none_is_refused(tmp_path: Path) -> None:
    values = np.zeros((12, 10), dtype=np.float32)
    values[3:9, 2:6] = 0.7
    Image.fromarray(values).save(tmp_path / "a.tif")
    assert read_masks(tmp_path, ALL).silhouette(0).mask.sum() == 24
    values[0, 0] = np.nan
    Image.fromarray(values).save(tmp_path / "a.tif")
    with pytest.raises(
        ValueError, match="a.tif: masks must be finite, got nan or infinity"
    ):
        read_masks(tmp_path, ALL)
