"""Numbers, times and cuts, for every kind of source: frames are those of the footage, whatever it is read from."""

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import posefit
from posefit.errors import InputError
from posefit.footage.extract import extract
from posefit.footage.extraction import Extraction
from posefit.footage.kinds import KINDS, Kind, resolve
from posefit.footage.live import live_views
from posefit.footage.options import SourceOptions
from posefit.footage.readers import read_array
from posefit.footage.scene import Scene
from posefit.footage.source import scene_of, views_of_masks
from posefit.footage.views import View, concatenated
from posefit.progress import QUIET
from tests.laws.sources import (
    COUNT,
    FILMS,
    FPS,
    MASKS,
    MOTIONS,
    NAMED,
    QUICK,
    SIZE,
    STREAMS,
    Stream,
    background,
    camera,
    masks,
    pictures,
    walk,
)

START, STOP = 2, 6


def seen(source: Any, **options: Any) -> Scene:
    """Return what a tracker gets of a source."""
    return scene_of(source, SourceOptions(**options))


def rate(film: Any) -> dict[str, float]:
    """Return the rate of a film as an option, unless its file states the rate."""
    return {"fps": FPS} if resolve(film).medium == "pictures" else {}


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
    images = pictures(masks())
    source = FILMS[kind](tmp_path / "all", images)
    options: dict[str, Any] = {"camera": [camera()], "extraction": how, **rate(source)}
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
    source = FILMS[kind](tmp_path / "film", pictures(masks()))
    options: dict[str, Any] = {"camera": [camera()], **rate(source)}
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


@pytest.mark.parametrize("fps", [FPS, 2 * FPS, FPS / 2])
def test_a_cut_motion_is_cut_again_and_fitted_by_the_numbers_that_it_has(
    fps: float,
) -> None:
    whole = posefit.load_motion("walk", FPS)
    cut = whole.frames(10, 20)
    # by hand: 20 frames after the first ten, at the other rate
    start = round(10 * fps / FPS)
    chosen = seen(cut, fps=fps, frames=(start + 2, start + 4))
    assert (chosen.first, chosen.count) == (start + 2, 2)
    same = cut.resampled(fps).joints[2:4]
    np.testing.assert_allclose(chosen.truth.joints, same, atol=1e-12)
    with pytest.raises(InputError, match=f"frames {start}:"):
        seen(cut, fps=fps, frames=(0, 2))
    how = {"method": "random@loose", "evaluations": 40, "progress": QUIET, "fps": fps}
    for frame in (None, start + 3):
        table = posefit.fit(cut, frame=frame, **how).track.to_pandas()
        assert table["frame"].tolist() == [frame or start]


@pytest.mark.parametrize("name", NAMED)
def test_named_motions_keep_their_numbers(name: str) -> None:
    check_numbered(seen(NAMED[name], frames=(START, STOP), fps=FPS), START, STOP)


@pytest.mark.parametrize("kind", STREAMS)
@pytest.mark.parametrize("step", [1, 3])
def test_frames_of_a_stream_keep_their_numbers_and_times(
    kind: str, step: int, how: Extraction
) -> None:
    frames = STREAMS[kind](masks(), pictures(masks()))
    views = [*live_views(Stream(frames, step), how, print)]  # type: ignore[arg-type]
    view = concatenated(views)
    numbers = np.arange(0, COUNT, step)
    assert view.numbers.tolist() == numbers.tolist()
    np.testing.assert_allclose(view.times, 100.0 + numbers / FPS)
    if kind == "masks":
        for k, number in enumerate(numbers.tolist()):
            np.testing.assert_array_equal(view.silhouette(k).mask, masks()[number])


@pytest.mark.parametrize("knows", [(False, False), (True, False), (False, True)])
def test_a_joined_view_knows_what_each_of_its_parts_knows(
    knows: tuple[bool, bool],
) -> None:
    views = list[View]()
    for count, known in zip((3, 2), knows, strict=True):
        view = read_array(masks()[:count], (None, None), None, FPS)
        landmarks = np.ones((count, 27, 3)) if known else None
        if known:
            view = replace(view, known=np.zeros_like(view.bits))
        views.append(replace(view, landmarks=landmarks))
    view = concatenated(views)
    assert len(view) == 5
    # frames of which some have no landmarks have none together
    assert view.landmarks is None
    shown = [view.silhouette(k).valid.any() for k in range(len(view))]
    assert shown == [not knows[0]] * 3 + [not knows[1]] * 2


@pytest.mark.parametrize("kind", MASKS)
def test_the_view_of_masks_has_their_numbers_times_and_bits_and_is_read_only(
    tmp_path: Path, kind: str
) -> None:
    source = resolve(MASKS[kind](tmp_path, masks()))
    (view,) = views_of_masks(source, (START, STOP), fps=FPS)
    numbers = np.arange(START, STOP)
    assert (view.numbers.tolist(), len(view)) == (numbers.tolist(), STOP - START)
    np.testing.assert_allclose(view.times, numbers / FPS)
    for k, number in enumerate(numbers.tolist()):
        np.testing.assert_array_equal(view.silhouette(k).mask, masks()[number])
    for array in (view.bits, view.usable, view.numbers, view.times):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize("kind", MASKS)
def test_mirrored_masks_are_the_mirrored_view(tmp_path: Path, kind: str) -> None:
    source = MASKS[kind](tmp_path / "a", masks())
    mirrored = MASKS[kind](tmp_path / "b", masks()[..., ::-1])
    pairs = zip(
        seen(source, fps=FPS).observations,
        seen(mirrored, fps=FPS).observations,
        strict=True,
    )
    for one, other in pairs:
        assert one.usable == other.usable
        mask = one.silhouettes[0].mask[:, ::-1]
        np.testing.assert_array_equal(mask, other.silhouettes[0].mask)


@pytest.mark.parametrize("kind", [*MASKS, *MOTIONS, *NAMED])
def test_extracted_masks_equal_the_given_masks_and_motions(
    tmp_path: Path, kind: str
) -> None:
    if kind in MASKS:
        source = MASKS[kind](tmp_path / "in", masks())
    else:
        source = MOTIONS[kind](tmp_path, walk()) if kind in MOTIONS else NAMED[kind]
    extract(source, tmp_path / "out", frames=(START, STOP))
    later = seen(tmp_path / "out" / "masks.npz", holes=None if kind in MASKS else 0.0)
    assert (later.first, later.count) == (START, STOP - START)
    once = seen(source, frames=(START, STOP))
    for one, other in zip(later.observations, once.observations, strict=True):
        assert one.usable == other.usable
        mask = one.silhouettes[0].mask
        np.testing.assert_array_equal(mask, other.silhouettes[0].mask)


def test_a_kind_of_source_is_a_line_of_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "walk.h5"
    path.write_bytes(np.packbits(masks()).tobytes())

    def read(path: Path, *how: Any) -> View:
        bits = np.frombuffer(path.read_bytes(), dtype=np.uint8)
        pixels = np.unpackbits(bits).reshape(-1, SIZE[1], SIZE[0])
        return read_array(pixels, *how)

    line = Kind("masks", lambda place: str(place).endswith(".h5"), view=read)
    monkeypatch.setattr("posefit.footage.kinds.KINDS", (line, *KINDS))
    check_numbered(seen(path, frames=(START, STOP), fps=FPS), START, STOP)
    check_alike(seen(path, fps=FPS), seen(masks(), fps=FPS))


@pytest.mark.parametrize("kind", [*MASKS, *FILMS, *MOTIONS, *NAMED])
def test_every_file_of_a_track_has_the_numbers_and_times_of_the_footage(
    tmp_path: Path, kind: str, how: Extraction
) -> None:
    options: dict[str, Any] = {**QUICK, "fps": FPS, "progress": QUIET}
    options["frames"] = (START, STOP)
    if kind in MASKS:
        source = MASKS[kind](tmp_path / "in", masks())
    elif kind in FILMS:
        source = FILMS[kind](tmp_path / "in", pictures(masks()))
        del options["fps"]
        options |= {"extraction": how, **rate(source)}
    else:
        source = MOTIONS[kind](tmp_path, walk()) if kind in MOTIONS else NAMED[kind]
    if kind == ".amc":
        options["rate"] = FPS
    if kind not in NAMED:
        options["camera"] = camera()
    posefit.track(source, out=tmp_path / "out", **options)
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


def test_a_pose_of_one_frame_has_its_number(tmp_path: Path) -> None:
    source = MASKS["folder"](tmp_path / "masks", masks())
    how: dict[str, Any] = {**QUICK, "camera": camera(), "fps": FPS, "progress": QUIET}
    fitted = posefit.fit(source, frame=5, **how)
    assert fitted.track.to_pandas()["frame"].tolist() == [5]


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
        assert any(
            "are missing, and the pose is held" in guess for guess in scene.guesses
        )
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
        match="same number in the names of all cameras, got 100 to 102 of .*a and 104",
    ):
        seen(sources, camera=[camera(each) for each in VIEWS])


@pytest.mark.parametrize("kind", [".npz", ".npy", "folder", "list of lists", "array"])
def test_no_source_is_that_of_two_cameras(tmp_path: Path, kind: str) -> None:
    source = MASKS[kind](tmp_path, masks())
    twice = [source[0], source[0]] if kind == "list of lists" else [source, source]
    with pytest.raises(InputError, match="its own source, got .* twice"):
        seen(twice, camera=[camera(each) for each in VIEWS], fps=FPS)
    if isinstance(source, Path):
        with pytest.raises(InputError, match="its own source"):
            resolve([source, str(source.parent / "." / source.name)])


@pytest.mark.parametrize("written", [False, True])
def test_no_two_cameras_are_at_one_place(tmp_path: Path, written: bool) -> None:
    sources = [masks(azimuth) for azimuth in VIEWS]
    one: Any = camera()
    if written:
        (tmp_path / "a.json").write_text(one.to_json())
        one = tmp_path / "a.json"
    with pytest.raises(InputError, match="the same place and direction for"):
        seen(sources, camera=[one, one], fps=FPS)
