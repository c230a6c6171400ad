"""Is what was taken out of a video a person? Somebody who is always in the picture must never pass for one."""

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner, Result

import posefit
from posefit.cli import main
from posefit.fitting.validation import BrokenRuleError
from posefit.footage import segmentation
from posefit.footage.masks import Views
from posefit.footage.quality import FrameQuality, disagreement, verdict
from posefit.footage.readers import read_masks
from posefit.footage.segmentation import Extraction, Segmentation
from posefit.footage.video import Video
from posefit.registry import Offer
from posefit.silhouette.foreground import Person
from tests.files import arrays
from tests.footage.composites import DEMO, LAWN, Kind, backgrounds, composed, filmed_backgrounds, overlap
from tests.footage.conftest import camera, truth

ALWAYS: tuple[Kind, ...] = ("jumping", "waving", "standing")
mediapipe = pytest.mark.skipif(find_spec("mediapipe") is None, reason="without mediapipe")


def run(*words: object) -> Result:
    return CliRunner().invoke(main, [str(word) for word in words])


@pytest.fixture(scope="module")
def films(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, list[Any]]]:
    folder, places = tmp_path_factory.mktemp("films"), backgrounds()
    cv2.imwrite(str(folder / "empty.png"), places[0])
    return {kind: composed(folder / f"{kind}.avi", kind, places) for kind in ("passing", "leaving", *ALWAYS)}


def segmented(path: Path, how: Extraction, frames: Any = (None, None)) -> tuple[Segmentation, list[Any]]:
    found = Segmentation(Video.of(path), how, frames)
    return found, [person.mask for _, person in found]


def test_somebody_who_is_always_there_is_refused_before_any_tracking(films: dict[str, Any], tmp_path: Path) -> None:
    for method in ["mixture", "median"]:
        for kind in ALWAYS:
            folder_of_case = tmp_path / str(len(list(tmp_path.iterdir())))
            folder_of_case.mkdir()
            result = run("track", films[kind][0], "--extraction", method, "--out", folder_of_case / "out")
            assert result.exit_code == 2, result.output
            lines = [line for line in result.stderr.splitlines() if line.startswith("posefit:")]
            assert len(lines) == 1
            assert f"{kind}.avi: the person seems to stand in the background" in lines[0]
            assert "give --background with an empty picture, or --extraction mediapipe" in lines[0]
            assert list(folder_of_case.iterdir()) == []


def test_extract_shows_the_masks_that_track_refuses(films: dict[str, Any], tmp_path: Path) -> None:
    result = run("extract", films["jumping"][0], "--out", tmp_path / "out", "--json")
    assert result.exit_code == 0, result.output
    said = json.loads(result.stdout)
    assert "the person seems to stand in the background" in said["warnings"][0]
    assert said["usable"] < 0.3 * said["frames"]
    assert "warning: " in result.stderr


def test_an_empty_picture_finds_him_whatever_he_does(films: dict[str, Any]) -> None:
    for kind in ["passing", "leaving", *ALWAYS]:
        path, masks = films[kind]
        found, seen = segmented(path, Extraction(background=str(path.with_name("empty.png"))))
        assert found.method == "mean"
        assert overlap(seen, masks) > 0.8
        assert found.verdict is None
        assert found.summary["usable"] >= 49  # of 60; who leaves is not seen whole in the last 11


def test_nothing_is_said_of_somebody_who_passes_by(films: dict[str, Any]) -> None:
    for method in ["mixture", "median"]:
        path, masks = films["passing"]
        found, seen = segmented(path, Extraction(method))
        assert overlap(seen, masks) > 0.8
        assert found.warnings == []
        assert found.summary["usable"] > 55


@mediapipe
@pytest.mark.parametrize("kind", ALWAYS)
def test_mediapipe_needs_no_background(films: dict[str, Any], kind: Kind) -> None:
    path, masks = films[kind]
    found, seen = segmented(path, Extraction("mediapipe"))
    assert overlap(seen, masks) > 0.85
    assert found.verdict is None


@pytest.mark.slow
@pytest.mark.skipif(not DEMO.is_file(), reason=f"no video at {DEMO}")
@pytest.mark.parametrize("kind", ["passing", "jumping", "standing"])
def test_the_same_holds_before_a_real_place(kind: Kind, tmp_path: Path) -> None:
    places = filmed_backgrounds()
    path, masks = composed(tmp_path / "a.avi", kind, places)
    cv2.imwrite(str(tmp_path / "empty.png"), places[0])
    roi = tuple(round(value * 640 / 1768) for value in LAWN)
    bad = kind != "passing"
    for method in ("mixture", "median"):
        found, _ = segmented(path, Extraction(method, roi=roi))  # type: ignore[arg-type]
        assert (found.verdict is not None and found.verdict.refused) == bad
    good = [Extraction(background=str(tmp_path / "empty.png"), roi=roi)]  # type: ignore[arg-type]
    if find_spec("mediapipe"):
        good.append(Extraction("mediapipe", roi=roi))  # type: ignore[arg-type]
    for how in good:
        found, seen = segmented(path, how)
        assert overlap(seen, masks) > 0.85
        assert found.verdict is None


@pytest.mark.slow
@pytest.mark.skipif(not DEMO.is_file(), reason=f"no video at {DEMO}")
def test_of_two_real_people_the_one_who_passes_is_good_and_the_one_on_the_spot_is_refused() -> None:
    walker, jumper = ((0, 420, 1520, 532), (55, 166)), ((380, 0, 600, 450), (0, 160))
    found, masks = segmented(DEMO, Extraction(roi=walker[0]), walker[1])
    assert found.warnings == []
    assert found.summary["usable"] >= 110
    assert segmented(DEMO, Extraction("median", roi=walker[0]), walker[1])[0].warnings == []
    refused = segmented(DEMO, Extraction(roi=jumper[0]), jumper[1])[0].verdict
    assert refused is not None
    assert refused.refused
    if find_spec("mediapipe"):
        found, others = segmented(DEMO, Extraction("mediapipe", roi=walker[0]), walker[1])
        assert found.warnings == []
        assert np.mean([(a & b).sum() / (a | b).sum() for a, b in zip(masks, others, strict=True)]) > 0.75
        found, _ = segmented(DEMO, Extraction("mediapipe", roi=jumper[0]), jumper[1])
        assert found.verdict is None
        assert found.summary["usable"] > 150


# the signs


def scene(shift: int = 0, tall: int = 60, wide: int = 22) -> tuple[Any, Any]:
    """Return a striped figure before grey, and its mask."""
    mask = np.zeros((120, 160), dtype=bool)
    mask[30 : 30 + tall, 60 + shift : 60 + shift + wide] = True
    image = np.full((120, 160, 3), 120, dtype=np.uint8)
    image[mask] = (20, 30, 60)
    image[::6][mask[::6]] = (200, 190, 180)
    return image, mask


def of(mask: Any) -> Person:
    return Person(mask, np.ones_like(mask), int(mask.sum()), 1, 0.0, False)


def looked(shown: Any, frames: int = 8, background: Any = None) -> list[dict[str, Any]]:
    """Return the rows of a figure that moves by 6 pixels a frame, of which `shown` leaves a part in the mask."""
    watch = FrameQuality(30.0, background)
    return [watch.row(image, of(shown(mask)), k) for k, (image, mask) in enumerate(scene(6 * k) for k in range(frames))]


def test_a_mask_that_covers_what_moves_is_usable() -> None:
    rows = looked(lambda mask: mask)
    assert all(row["usable"] for row in rows)
    assert max(row["beside"] for row in rows) == 0.0
    assert {row["longer_side"] for row in rows} == {60}


def test_a_mask_beside_which_most_of_what_moves_lies_is_not_usable() -> None:
    def arm(mask: Any) -> Any:
        part = mask.copy()
        part[45:] = False
        part[:, : np.flatnonzero(mask.any(axis=0))[12]] = False
        return part

    rows = looked(arm)
    assert min(row["beside"] for row in rows[4:]) > 0.5
    assert not any(row["usable"] for row in rows[4:])


def test_what_has_no_persons_shape_is_not_usable() -> None:
    for tall, wide in [(10, 4), (60, 2), (40, 40)]:
        image, mask = scene(0, tall, wide)
        assert FrameQuality(30.0).row(image, of(mask), 0)["usable"] == 0


def test_a_place_that_somebody_has_left_is_a_ghost() -> None:
    with_him, mask = scene()
    empty = np.full_like(with_him, 120)
    assert FrameQuality(30.0, background=with_him).row(empty, of(mask), 0)["ghost"] == 1
    assert FrameQuality(30.0, background=empty).row(with_him, of(mask), 0)["ghost"] == 0
    assert FrameQuality(30.0).row(empty, of(mask), 0)["ghost"] == 0


def test_one_mask_twice_as_large_as_the_others_is_not_usable_but_a_person_who_stays_so_is() -> None:
    watch = FrameQuality(30.0)
    sizes = [18] * 6 + [29] + [18] * 6 + [29] * 16
    rows = [watch.row(image, of(mask), k) for k, (image, mask) in enumerate(scene(0, 60, wide) for wide in sizes)]
    assert [row["usable"] for row in rows[:13]] == [1] * 6 + [0] + [1] * 6
    assert rows[-1]["usable"] == 1


def test_a_verdict_is_given_on_what_all_frames_say() -> None:
    def rows(
        beside: float = 0.0, areas: tuple[int, ...] = (100, 100), ghost: int = 0, usable: int = 1, pieces: int = 1
    ) -> Any:
        return [
            {"frame": k, "area": areas[k % 2], "longer_side": 10, "touches_border": 0, "beside": beside, "ghost": ghost}
            | {"usable": usable, "pieces": pieces}
            for k in range(20)
        ]

    assert verdict(rows(), "mixture", learned=True) is None
    assert verdict(rows(0.2, (100, 110)), "mixture", learned=True) is None
    said = verdict(rows(0.6, (100, 150)), "mixture", learned=True)
    assert said is not None
    assert said.refused
    assert said.text.startswith("the person seems to stand in the background: 60% of what moves lies outside the masks")
    for warned, words in (
        (rows(0.0, (100, 150)), "parts of the person seem to be missing"),
        (rows(0.6), "60% of what moves near the person lies outside"),
    ):
        said = verdict(warned, "mean", learned=False)
        assert said is not None
        assert not said.refused
        assert words in said.text
        assert "--background" not in said.text
    assert verdict(rows(pieces=2), "median", learned=True) is None
    parts = verdict(rows(0.16, (100, 150), pieces=2), "median", learned=True)
    assert parts is not None
    assert parts.refused
    assert parts.text == (
        "the masks change by 50% from frame to frame and are in pieces in 100% of the frames: parts of the person seem "
        "to be missing; give --background with an empty picture, or --extraction mediapipe"
    )
    ghosts = verdict(rows(ghost=1), "median", learned=True)
    assert ghosts is not None
    assert ghosts.refused
    assert "100% of the masks show a place that is empty now" in ghosts.text
    nobody = verdict(rows(usable=0)[:4], "mediapipe", learned=True)
    assert nobody is not None
    assert nobody.text == "expected masks of a person, got none in any of 4 frames; --roi says where to look"


# several cameras


def views(folder: Path, azimuths: list[float], part: Any = lambda mask: mask) -> Views:
    seen = []
    for k, azimuth in enumerate(azimuths):
        (folder / str(k)).mkdir(parents=True)
        for n, mask in enumerate(truth(azimuth)[8:16]):
            cv2.imwrite(str(folder / str(k) / f"{n}.png"), 255 * part(mask).astype(np.uint8))
        seen.append(read_masks(folder / str(k), (None, None)))
    return Views(seen)


def upper(mask: Any) -> Any:
    rows = np.flatnonzero(mask.any(axis=1))
    part = mask.copy()
    part[rows[0] + len(rows) // 3 :] = False
    return part


def test_cameras_see_one_person_of_his_height_or_it_is_said(tmp_path: Path) -> None:
    azimuths = [np.pi / 2, 0.6]
    cameras = [camera(azimuth) for azimuth in azimuths]
    assert disagreement(views(tmp_path / "a", azimuths), cameras, 1.75) is None
    parts = disagreement(views(tmp_path / "b", azimuths, upper), cameras, 1.75)
    assert parts is not None
    assert parts.startswith("expected a person of 1.75 m, got masks 0.")
    moved = [
        posefit.Camera(one.width, one.height, one.focal, one.centre, one.rotation, one.translation + away)
        for one, away in zip(cameras, ([0.0, 0.0, 0.0], [0.0, 1.5, 0.0]), strict=True)
    ]
    apart = disagreement(views(tmp_path / "c", azimuths), moved, 1.75)
    assert apart is not None
    assert "expected cameras that see one person, got views that pass each other by 1.5 m" in apart
    with pytest.raises(ValueError, match=r"0: expected cameras that see one person, got views that pass"):
        posefit.track([tmp_path / "c" / "0", tmp_path / "c" / "1"], camera=moved)


# plugins


class Half:
    """Says that the left half is the person."""

    def __init__(self, footage: Any, *, wrong: str = "") -> None:
        self.footage, self.wrong = footage, wrong
        self.count, self.first = len(footage), next(iter(footage.frames()))

    def segment(self, image: Any) -> Any:
        if self.wrong == "fails":
            raise KeyError("lost")
        mask = np.zeros(image.shape[:2], dtype=bool)
        mask[20:90, : image.shape[1] // 4] = True
        if self.wrong == "shape":
            return mask[1:], mask
        return (mask.astype(np.uint8), mask) if self.wrong == "type" else (mask, ~mask)


@pytest.fixture
def half(monkeypatch: pytest.MonkeyPatch) -> None:
    real = segmentation.registry()

    class Known:
        offers = real.offers

        @staticmethod
        def offer(kind: Any, name: str) -> Offer:
            return Offer("segmenter", "half", Half, "posefit-half", "1.0") if name == "half" else real.offer(kind, name)

    monkeypatch.setattr(segmentation, "registry", Known)


@pytest.mark.usefixtures("half")
def test_a_segmenter_sees_the_roi_alone_and_its_masks_are_put_where_that_is(filmed: tuple[Path, list[Any]]) -> None:
    found, masks = segmented(filmed[0], Extraction("half", roi=(40, 10, 80, 100)), (0, 4))
    assert masks[0].shape == (120, 160)
    rows, columns = np.flatnonzero(masks[0].any(axis=1)), np.flatnonzero(masks[0].any(axis=0))
    assert (rows[0], columns[0], columns[-1]) == (30, 40, 59)
    assert found.summary["frames"] == 4


@pytest.mark.usefixtures("half")
def test_a_segmenter_that_breaks_a_rule_is_named(filmed: tuple[Path, list[Any]]) -> None:
    for wrong, message in [
        (
            "shape",
            r"segmenter 'half': segment must return two boolean masks of shape \(120, 160\), got \(119, 160\) bool",
        ),
        ("type", r"segmenter 'half': segment must return two boolean masks .* got \(120, 160\) uint8"),
        ("fails", "segmenter 'half': segment must not fail, got KeyError: 'lost'"),
    ]:
        with pytest.raises(BrokenRuleError, match=message):
            segmented(filmed[0], Extraction("half", settings={"wrong": wrong}))


def test_settings_of_a_segmenter_are_checked(filmed: tuple[Path, list[Any]]) -> None:
    with pytest.raises(ValueError, match="a setting of mixture must be one of history, threshold, got 'colour'"):
        Extraction(settings={"colour": 3})
    with pytest.raises(ValueError, match="history must be at least 1, got 0"):
        segmented(filmed[0], Extraction(settings={"history": 0}))
    result = run("track", filmed[0], "--set", "mixture.threshold=-3")
    assert result.exit_code == 2
    assert "threshold must be above 0, got -3" in result.stderr
    result = run("track", filmed[0], "--set", "median.samples=3")
    assert "--set must name one of " in result.stderr


def test_settings_of_a_segmenter_reach_it(filmed: tuple[Path, list[Any]], tmp_path: Path) -> None:
    for name, words in (("a", []), ("b", ["--set", "mixture.threshold=4000"])):
        assert run("extract", filmed[0], "--frames", "14:40", *words, "--out", tmp_path / name).exit_code == 0
    areas = [arrays(tmp_path / name / "masks.npz")["masks"].sum() for name in ("a", "b")]
    assert areas[1] < 0.8 * areas[0]
