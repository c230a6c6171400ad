"""Numbers, times and cuts, for every kind of source: frames are those of the footage, whatever it is read from."""

import csv
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import posefit
from posefit.footage.extract import extract
from posefit.footage.scene import Scene
from posefit.footage.segmentation import Extraction
from posefit.footage.source import scene_of, sources_of
from posefit.progress import QUIET
from tests.laws.sources import (
    COUNT,
    FILMS,
    FPS,
    MASKS,
    MOTIONS,
    QUICK,
    background,
    camera,
    masks,
    pictures,
    walk,
)

START, STOP = 2, 6


def seen(source: Any, **options: Any) -> Scene:
    """Return what a tracker gets of a source."""
    return scene_of(sources_of(source), **options)


def check_numbered(scene: Scene, start: int, stop: int) -> None:
    """Check that a scene has the frames from start to stop, at their rate: a track's numbers and times are these."""
    assert (scene.first, scene.count, scene.fps) == (start, stop - start, FPS)


def check_alike(one: Scene, other: Scene) -> None:
    """Check that every frame of two scenes shows the same."""
    for first, second in zip(one.observations, other.observations, strict=True):
        assert first.usable == second.usable
        for mine, yours in zip(first.silhouettes, second.silhouettes, strict=True):
            np.testing.assert_array_equal(mine.mask, yours.mask)
            np.testing.assert_array_equal(mine.valid, yours.valid)
    np.testing.assert_array_equal(one.anchor, other.anchor)


@pytest.mark.parametrize("kind", MASKS)
def test_masks_keep_their_numbers_and_a_cut_is_that_of_the_source(
    tmp_path: Path, kind: str
) -> None:
    how: dict[str, Any] = {"camera": [camera()], "fps": FPS}
    source = MASKS[kind](tmp_path / "all", masks())
    whole = seen(source, **how)
    check_numbered(whole, 0, COUNT)
    check_alike(whole, seen(masks(), **how))
    chosen = seen(source, frames=(START, STOP), **how)
    check_numbered(chosen, START, STOP)
    cut = seen(MASKS[kind](tmp_path / "cut", masks()[START:STOP]), **how)
    check_numbered(cut, 0, STOP - START)
    check_alike(chosen, cut)


@pytest.fixture(scope="module")
def how(tmp_path_factory: pytest.TempPathFactory) -> Extraction:
    """Return how the person is taken out of a film: before a background that is known, each frame by itself."""
    path = tmp_path_factory.mktemp("place") / "empty.png"
    assert cv2.imwrite(str(path), background())
    return Extraction(background=str(path))


@pytest.mark.parametrize("kind", FILMS)
def test_films_keep_their_numbers_and_a_cut_is_that_of_the_source(
    tmp_path: Path, kind: str, how: Extraction
) -> None:
    options: dict[str, Any] = {"camera": [camera()], "extraction": how}
    if "pictures" in kind:
        options["fps"] = FPS
    images = pictures(masks())
    source = FILMS[kind](tmp_path / "all", images)
    check_numbered(seen(source, **options), 0, COUNT)
    chosen = seen(source, frames=(START, STOP), **options)
    check_numbered(chosen, START, STOP)
    cut = seen(FILMS[kind](tmp_path / "cut", images[START:STOP]), **options)
    check_alike(chosen, cut)


@pytest.mark.parametrize("kind", FILMS)
@pytest.mark.parametrize("frames", [(None, None), (START, STOP)])
def test_masks_that_were_extracted_give_the_track_of_the_film(
    tmp_path: Path, kind: str, frames: Any, how: Extraction
) -> None:
    options: dict[str, Any] = {"camera": [camera()]}
    if "pictures" in kind:
        options["fps"] = FPS
    source = FILMS[kind](tmp_path / "film", pictures(masks()))
    whole = seen(source, extraction=how, frames=frames, **options)
    extract(source, tmp_path / "out", how, frames=frames)
    later = seen(tmp_path / "out" / "masks.npz", **options)
    first, stop, _ = slice(*frames).indices(COUNT)
    check_numbered(later, first, stop)
    check_alike(later, whole)
    # numbers that a cut keeps choose in it, too
    if first:
        part = seen(tmp_path / "out" / "masks.npz", frames=(first + 1, stop), **options)
        check_numbered(part, first + 1, stop)


@pytest.mark.parametrize("kind", MOTIONS)
def test_motions_keep_their_numbers_and_a_cut_is_that_of_the_source(
    tmp_path: Path, kind: str
) -> None:
    how: dict[str, Any] = {"camera": [camera()], "fps": FPS}
    if kind == ".amc":
        how["rate"] = FPS
    source = MOTIONS[kind](tmp_path / "all", walk())
    check_numbered(seen(source, **how), 0, COUNT)
    chosen = seen(source, frames=(START, STOP), **how)
    check_numbered(chosen, START, STOP)
    part = walk().frames(START, STOP)
    cut = seen(MOTIONS[kind](tmp_path / "cut", part), **how)
    # files hold so many digits
    np.testing.assert_allclose(chosen.truth.joints, cut.truth.joints, atol=1e-5)


@pytest.mark.parametrize("name", ["walk", "16_15"])
def test_named_motions_keep_their_numbers(name: str) -> None:
    check_numbered(seen(name, frames=(START, STOP), fps=FPS), START, STOP)


def test_every_file_of_a_track_has_the_numbers_and_times_of_the_footage(
    tmp_path: Path,
) -> None:
    source = MASKS["folder"](tmp_path / "masks", masks())
    how: dict[str, Any] = {**QUICK, "camera": camera(), "fps": FPS, "progress": QUIET}
    posefit.track(source, frames=(START, STOP), out=tmp_path / "out", **how)
    fitted = posefit.fit(source, frame=5, **how)
    assert fitted.track.to_pandas()["frame"].tolist() == [5]
    numbers = np.arange(START, STOP)
    for name in ("frames.csv", "angles.csv"):
        with (tmp_path / "out" / name).open(newline="") as file:
            rows = list(csv.DictReader(file))
        assert [int(row["frame"]) for row in rows] == numbers.tolist()
        seconds = [float(row["seconds"]) for row in rows]
        np.testing.assert_allclose(seconds, numbers / FPS, atol=1e-6)
    with np.load(tmp_path / "out" / "poses.npz") as stored:
        assert stored["frames"].tolist() == numbers.tolist()
    for name, head in (("track.trc", "Frame#"), ("track.mot", "time")):
        lines = (tmp_path / "out" / name).read_text().splitlines()
        after = next(k for k, line in enumerate(lines) if line.startswith(head)) + 1
        rows = [line.split() for line in lines[after:] if line.strip()]
        rows = [row for row in rows if not row[0].startswith("X")]
        times = [float(row[1 if name == "track.trc" else 0]) for row in rows]
        np.testing.assert_allclose(times, numbers / FPS, atol=1e-5)


VIEWS = (1.2, 2.4)


def _two(tmp_path: Path, numbers: Any, write: Any) -> list[Any]:
    """Return what two cameras took, the frames of these numbers each."""
    return [
        write(tmp_path / name, masks(azimuth), taken)
        for name, azimuth, taken in zip("ab", VIEWS, numbers, strict=True)
    ]


def _numbered_folder(folder: Path, shown: Any, numbers: Any, form: str) -> Path:
    folder.mkdir(parents=True)
    for number in numbers:
        image = 255 * shown[number].astype(np.uint8)
        assert cv2.imwrite(str(folder / form.format(100 + number)), image)
    return folder


def _numbered_film(folder: Path, shown: Any, numbers: Any, form: str) -> Path:
    folder.mkdir(parents=True)
    for number, image in enumerate(pictures(shown)):
        if number in numbers:
            assert cv2.imwrite(str(folder / form.format(100 + number)), image)
    return folder


def _numbered_npz(folder: Path, shown: Any, numbers: Any, _: str) -> Path:
    folder.mkdir(parents=True)
    first = numbers[0]
    np.savez(folder / "m.npz", masks=shown[list(numbers)], first=first)
    return folder / "m.npz"


NUMBERED = {
    "folder": (_numbered_folder, "f{}.png"),
    "number before another": (_numbered_folder, "f{}_cam2.png"),
    "list": (lambda *given: sorted(_numbered_folder(*given).iterdir()), "f{}.png"),
    "pictures": (_numbered_film, "f{}.png"),
    ".npz": (_numbered_npz, ""),
}
TAKEN = {
    "one begins later": (range(0, 8), range(2, 8)),
    "one ends later": (range(0, 6), range(0, 8)),
    "both": (range(0, 6), range(2, 8)),
    "the first begins later": (range(2, 8), range(0, 6)),
}


@pytest.mark.parametrize("kind", NUMBERED)
@pytest.mark.parametrize("taken", TAKEN)
def test_frames_of_cameras_are_paired_by_number(
    tmp_path: Path, kind: str, taken: str, how: Extraction
) -> None:
    write, form = NUMBERED[kind]
    numbers = TAKEN[taken]
    sources = _two(
        tmp_path, numbers, lambda folder, shown, them: write(folder, shown, them, form)
    )
    options: dict[str, Any] = {"fps": FPS, "camera": [camera(each) for each in VIEWS]}
    if kind == "pictures":
        options["extraction"] = how
    scene = seen(sources, **options)
    both = sorted(set(numbers[0]) & set(numbers[1]))
    lowest = 0 if kind == ".npz" else min(numbers[0][0], numbers[1][0])
    if kind == ".npz":
        assert (scene.first, scene.count) == (both[0], len(both))
        assert any("which all cameras have" in guess for guess in scene.guesses)
    else:
        assert (scene.first, scene.count) == (0, 8)
        assert any("are missing, and are held" in guess for guess in scene.guesses)
    for number in both:
        shown = scene.observations[number - lowest - scene.first].silhouettes
        for silhouette, azimuth in zip(shown, VIEWS, strict=True):
            right = masks(azimuth)[number]
            agreed = (silhouette.mask & right).sum() / (silhouette.mask | right).sum()
            # holes are filled, and a person taken out has a rim
            assert agreed > (0.8 if kind == "pictures" else 0.99)


def test_images_without_a_common_number_are_refused(tmp_path: Path) -> None:
    sources = _two(
        tmp_path,
        (range(0, 3), range(4, 7)),
        lambda folder, shown, them: _numbered_folder(folder, shown, them, "f{}.png"),
    )
    with pytest.raises(
        ValueError,
        match="one number in the names of all cameras, got 100 to 102 of .*a and 104",
    ):
        seen(sources, camera=[camera(each) for each in VIEWS])
