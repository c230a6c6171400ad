"""Whether masks from a video are a person's: one who is always in the picture is refused; and which way they face."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from posefit.errors import InputError, NoPersonError
from posefit.fitting.validation import BrokenRuleError
from posefit.footage import source
from posefit.footage.extraction import Extraction
from posefit.footage.facing import facings_on_the_spot, yaws_of
from posefit.footage.options import SourceOptions
from posefit.footage.quality import FrameQuality, Verdict, moved_pixels, verdict
from posefit.footage.segmentation import Segmentation
from posefit.footage.source import scene_of
from posefit.footage.video import Video
from posefit.footage.views import View
from posefit.geometry.camera import Camera
from posefit.progress import QUIET
from posefit.registry import Registry, registry
from posefit.silhouette.foreground import Image, Person
from tests.cases import each
from tests.commands import error_of
from tests.footage.composites import DEMO, Kind, backgrounds, composed
from tests.footage.conftest import Box, camera, iou, truth

ALWAYS: tuple[Kind, ...] = ("jumping", "waving", "standing")
mediapipe = pytest.mark.skipif(
    find_spec("mediapipe") is None, reason="without mediapipe"
)


@pytest.fixture(scope="module")
def films(
    tmp_path_factory: pytest.TempPathFactory,
) -> dict[str, tuple[Path, list[Any]]]:
    folder = tmp_path_factory.mktemp("films")
    places = backgrounds()
    cv2.imwrite(str(folder / "empty.png"), places[0])
    return {
        kind: composed(folder / f"{kind}.avi", kind, places)
        for kind in ("passing", "leaving", *ALWAYS)
    }


def segmented(
    path: Path, how: Extraction, frames: Any = (None, None)
) -> tuple[View, list[Any]]:
    view, *_ = Segmentation(Video.of(path), how, frames).read()
    return view, [view.silhouette(k).mask for k in range(len(view))]


def overlap(masks: list[Any], true: list[Any]) -> float:
    """Return the mean IoU of masks with the true ones, where the whole person is in the picture."""
    whole = [
        k for k, mask in enumerate(true) if mask.any() and not mask[:, [0, -1]].any()
    ]
    return float(np.mean([iou(masks[k], true[k]) for k in whole]))


@each("method", ["mixture", "median"])
@each("kind", ALWAYS)
def test_a_person_who_is_always_there_is_refused_before_any_tracking(
    films: dict[str, Any], tmp_path: Path, method: str, kind: Kind
) -> None:
    error = error_of(
        "track", films[kind][0], "--extraction", method, "--out", tmp_path / "out"
    )
    assert f"{kind}.avi: the person seems to stand in the background" in error
    assert "give --background with an empty picture, or --extraction mediapipe" in error
    assert list(tmp_path.iterdir()) == []


@each(
    ("kind", "cameras", "network", "used"),
    [
        ("passing", 1, "right", "mediapipe"),
        ("passing", 2, "right", "mixture"),
        ("jumping", 2, "right", "mediapipe"),
        ("passing", 1, "empty", "mixture"),
        ("jumping", 2, "empty", None),
    ],
)
def test_if_a_network_is_installed_the_segmenter_without_doubts_is_used(
    films: dict[str, Any],
    kind: Kind,
    cameras: int,
    network: str,
    used: str | None,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    path, true = films[kind]
    paths = [path, Path(shutil.copy(path, tmp_path / path.name))][:cameras]

    class Network:
        def __init__(self, film: object) -> None:
            self.masks = iter(true if network == "right" else np.zeros_like(true))

        def segment(self, image: Image) -> tuple[Any, Any]:
            mask = next(self.masks)
            return mask, np.zeros_like(mask)

    plugins = registry().plugins
    offer = replace(
        registry().offers["segmenter"]["mediapipe"], factory=Network, needs=None
    )
    installed = Registry((*plugins, plugins[0]._replace(offers=(offer,))))
    for module in ("extraction", "segmenter"):
        monkeypatch.setattr(f"posefit.footage.{module}.registry", lambda: installed)
    target = np.array([0.0, 0.9, 0.0])
    around = [
        Camera.around(target, 0.5 * k, 4.0, Video.of(path).size) for k in range(cameras)
    ]
    view: dict[str, Any] = {"camera": around if cameras > 1 else (), "height": 1.7}
    if used is None:
        with pytest.raises(
            InputError, match="the person seems to stand in the background"
        ):
            scene_of(paths, SourceOptions(**view))
        return
    scene = scene_of(paths, SourceOptions(**view))
    masks = [observation.silhouettes[0].mask for observation in scene.observations]
    assert (overlap(masks, true) > 0.95) == (used == "mediapipe")
    first, second = (
        ("mediapipe", "mixture") if cameras == 1 else ("mixture", "mediapipe")
    )
    exchanged = any(
        f"segmented by {second} instead of {first}: " in text for text in scene.warnings
    )
    assert exchanged == (used == second)


@each("kind", ["passing", "leaving", *ALWAYS])
def test_with_an_empty_picture_the_person_is_segmented_in_any_motion(
    films: dict[str, Any], kind: Kind
) -> None:
    path, true = films[kind]
    segmentation, masks = segmented(
        path, Extraction(background=str(path.with_name("empty.png")))
    )
    assert overlap(masks, true) > 0.8
    assert not segmentation.doubt
    # of 60; a person who leaves is not whole in the last 11
    assert segmentation.usable.sum() >= 49


@each("method", ["mixture", "median"])
def test_a_person_who_passes_by_causes_no_warning(
    films: dict[str, Any], method: str
) -> None:
    path, true = films["passing"]
    segmentation, masks = segmented(path, Extraction(method))
    assert overlap(masks, true) > 0.8
    assert segmentation.warnings == []
    assert segmentation.usable.sum() > 55


@mediapipe
@each("kind", ALWAYS)
def test_mediapipe_needs_no_background(films: dict[str, Any], kind: Kind) -> None:
    path, true = films[kind]
    segmentation, masks = segmented(path, Extraction("mediapipe"))
    assert overlap(masks, true) > 0.85
    assert not segmentation.doubt


@pytest.mark.slow
@pytest.mark.skipif(not DEMO.is_file(), reason=f"no video at {DEMO}")
def test_a_person_who_walks_through_is_good_and_one_on_the_spot_is_refused() -> None:
    walker = ((0, 420, 1520, 532), (55, 166))
    jumper = ((380, 0, 600, 450), (0, 160))
    segmentation, masks = segmented(DEMO, Extraction(roi=walker[0]), walker[1])
    assert segmentation.warnings == []
    assert segmentation.usable.sum() >= 110
    assert (
        segmented(DEMO, Extraction("median", roi=walker[0]), walker[1])[0].warnings
        == []
    )
    verdict = segmented(DEMO, Extraction(roi=jumper[0]), jumper[1])[0].verdict
    assert verdict is not None
    assert verdict.refused
    if find_spec("mediapipe"):
        segmentation, others = segmented(
            DEMO, Extraction("mediapipe", roi=walker[0]), walker[1]
        )
        assert segmentation.warnings == []
        assert (
            np.mean(
                [
                    iou(first, second)
                    for first, second in zip(masks, others, strict=True)
                ]
            )
            > 0.75
        )
        segmentation, _ = segmented(
            DEMO, Extraction("mediapipe", roi=jumper[0]), jumper[1]
        )
        assert not segmentation.doubt
        assert segmentation.usable.sum() > 150


def figure(shift: int = 0, tall: int = 60, wide: int = 22) -> tuple[Any, Any]:
    """Return a striped figure before grey, and its mask."""
    mask = np.zeros((120, 160), dtype=bool)
    mask[30 : 30 + tall, 60 + shift : 60 + shift + wide] = True
    image = np.full((120, 160, 3), 120, dtype=np.uint8)
    image[mask] = (20, 30, 60)
    image[::6][mask[::6]] = (200, 190, 180)
    return image, mask


def of(mask: Any) -> Person:
    return Person(mask, np.ones_like(mask), int(mask.sum()), 1, 0.0, False)


def arm(mask: Any) -> Any:
    """Return a small part of a figure's mask."""
    part = mask.copy()
    part[45:] = False
    part[:, : np.flatnonzero(mask.any(axis=0))[12]] = False
    return part


def test_a_mask_is_not_usable_if_most_motion_is_outside_it() -> None:
    quality = FrameQuality(30.0)
    rows = [
        quality.row(image, of(arm(mask)), k)
        for k, (image, mask) in enumerate(figure(6 * k) for k in range(8))
    ]
    assert min(row["beside"] for row in rows[4:]) > 0.5
    assert not any(row["usable"] for row in rows[4:])


def test_before_a_camera_that_pans_masks_that_need_no_still_background_are_usable(
    tmp_path: Path, segmenter: Callable[..., None]
) -> None:
    rng = np.random.default_rng(0)
    path = tmp_path / "pan.avi"
    wide = cv2.resize(
        rng.integers(0, 255, (30, 160, 3), dtype=np.uint8),
        (640, 120),
        interpolation=cv2.INTER_NEAREST,
    )
    image, mask = figure()
    writer = cv2.VideoWriter(
        str(path), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (160, 120)
    )
    for k in range(24):
        writer.write(np.where(mask[..., None], image, wide[:, 12 * k : 12 * k + 160]))
    writer.release()

    class Network:
        def __init__(self, film: object) -> None:
            pass

        def segment(self, image: Image) -> tuple[Any, Any]:
            return mask, np.zeros_like(mask)

    for still, usable in ((True, 1), (False, 24)):  # of the first there is none before
        segmenter("network", Network, still_background=still)
        segmentation, _ = segmented(path, Extraction("network"))
        assert segmentation.usable.sum() == usable
        assert segmentation.moves
        assert any("outside" in text for text in segmentation.warnings) == still


def test_a_mask_without_a_persons_shape_is_not_usable() -> None:
    for tall, wide in [(10, 4), (60, 2), (40, 40)]:
        image, mask = figure(0, tall, wide)
        assert FrameQuality(30.0).row(image, of(mask), 0)["usable"] == 0


def test_a_place_that_the_person_has_left_is_a_ghost() -> None:
    with_person, mask = figure()
    empty = np.full_like(with_person, 120)
    assert (
        FrameQuality(30.0, background=with_person).row(empty, of(mask), 0)["ghost"] == 1
    )
    assert (
        FrameQuality(30.0, background=empty).row(with_person, of(mask), 0)["ghost"] == 0
    )
    assert FrameQuality(30.0).row(empty, of(mask), 0)["ghost"] == 0


def test_people_of_one_film_are_judged_as_if_each_were_alone() -> None:
    figures = [figure(6 * k) for k in range(8)]
    whole = FrameQuality(30.0)
    arms = whole.duplicate()
    alone = FrameQuality(30.0)
    later = whole
    for k, (image, mask) in enumerate(figures):
        # somebody who appears in the fourth frame begins like the first one
        if k == 3:
            later = whole.duplicate()
        row = whole.row(image, of(mask), k)
        assert arms.row(image, of(arm(mask)), k) == alone.row(image, of(arm(mask)), k)
        if k >= 3:
            assert later.row(image, of(mask), k) == row


def test_one_mask_twice_as_large_as_the_others_is_not_usable_but_a_person_who_stays_so_is() -> (
    None
):
    quality = FrameQuality(30.0)
    sizes = [18] * 6 + [29] + [18] * 6 + [29] * 16
    rows = [
        quality.row(image, of(mask), k)
        for k, (image, mask) in enumerate(figure(0, 60, wide) for wide in sizes)
    ]
    assert [row["usable"] for row in rows[:13]] == [1] * 6 + [0] + [1] * 6
    assert rows[-1]["usable"] == 1


def rows(
    beside: float = 0.0,
    areas: tuple[int, ...] = (100, 100),
    ghost: int = 0,
    usable: int = 1,
    pieces: int = 1,
) -> list[dict[str, Any]]:
    return [
        {
            "frame": k,
            "area": areas[k % 2],
            "longer_side": 10,
            "touches_border": 0,
            "beside": beside,
            "ghost": ghost,
        }
        | {"usable": usable, "pieces": pieces}
        for k in range(20)
    ]


@each(
    ("rows", "method", "learned", "refused", "text"),
    [
        (rows(), "mixture", True, None, ""),
        (rows(0.2, (100, 110)), "mixture", True, None, ""),
        (
            [{**row, "touches_border": 1, "usable": 0} for row in rows()],
            "mixture",
            True,
            True,
            "got one cut by the edge in 20 of 20 frames",
        ),
        (rows(pieces=2), "median", True, None, ""),
        (
            rows(0.6, (100, 150)),
            "mixture",
            True,
            True,
            "in the background: 60% of what moves lies outside the masks",
        ),
        (
            rows(0.0, (100, 150)),
            "mean",
            False,
            False,
            "parts of the person seem to be missing; --extraction mediapipe",
        ),
        (
            rows(0.6),
            "mean",
            False,
            False,
            "60% of what moves near the person lies outside",
        ),
        (
            rows(0.16, (100, 150), pieces=2),
            "median",
            True,
            True,
            "from frame to frame and are in pieces in 100%",
        ),
        (
            rows(ghost=1),
            "median",
            True,
            True,
            "100% of the masks show a place that is empty now",
        ),
        (
            rows(usable=0)[:4],
            "mediapipe",
            True,
            True,
            "got none in any of 4 frames; --roi says where to look",
        ),
    ],
)
def test_the_verdict_follows_from_all_frames(
    rows: list[dict[str, Any]],
    method: str,
    learned: bool,
    refused: bool | None,
    text: str,
) -> None:
    result = verdict(rows, method, learned=learned)
    assert (None if result is None else result.refused) is refused
    assert result is None or text in result.text


def test_cameras_that_disagree_on_the_person_are_refused(tmp_path: Path) -> None:
    azimuths = (np.pi / 2, 0.6)
    sources = [tmp_path / "a.npz", tmp_path / "b.npz"]
    cameras = [camera(azimuth) for azimuth in azimuths]
    masks = [truth(azimuth)[8:16] for azimuth in azimuths]
    heads = [
        [mask & (np.cumsum(mask.any(axis=1)) < 25)[:, None] for mask in shown]
        for shown in masks
    ]
    moved = [
        cameras[0],
        replace(cameras[1], translation=cameras[1].translation + [0.0, 1.5, 0.0]),
    ]
    for shown, placed, message in (
        (heads, cameras, "expected a person of 1.75 m, got masks 0."),
        (
            masks,
            moved,
            "expected cameras that see one person, got views that disagree by 1.5 m",
        ),
    ):
        for path, part in zip(sources, shown, strict=True):
            np.savez(path, masks=part)
        with pytest.raises(ValueError, match=message):
            scene_of(sources, SourceOptions(camera=placed, height=1.75))


def test_a_segmenter_that_breaks_a_rule_is_named(
    filmed: tuple[Path, list[Any]], segmenter: Callable[..., None]
) -> None:
    segmenter("box", Box)
    for wrong, message in [
        (
            "shape",
            r"segment must return two boolean masks of shape \(120, 160\), got \(119, 160\) bool",
        ),
        (
            "type",
            r"segmenter 'box': segment must return two boolean masks .* got \(120, 160\) uint8",
        ),
        ("fails", "segmenter 'box': segment must not fail, got KeyError: 'lost'"),
    ]:
        with pytest.raises(BrokenRuleError, match=message):
            segmented(filmed[0], Extraction("box", settings={"wrong": wrong}))


MIDDLE = np.array([0.0, 1.0, 0.0])
# one that looks along -z, which a person with yaw 0 faces, and one that looks along -x, at the person's left side
FRONT, LEFT = (
    Camera.around(MIDDLE, azimuth, 5.0, (160, 120)) for azimuth in (0.0, np.pi / 2)
)
FPS = 4.0  # two frames to either side count


def degrees(facings: list[float], camera: Camera = FRONT) -> list[float]:
    return [
        round(float(yaw), 6)
        for yaw in np.degrees(yaws_of(np.radians(facings), camera, FPS))
    ]


def test_a_heading_is_converted_from_the_camera_to_the_world() -> None:
    assert degrees([10.0] * 3) == [10.0] * 3
    assert degrees([10.0] * 3, LEFT) == [100.0] * 3


def test_a_wrong_picture_does_not_count_and_a_turn_continues_past_180_degrees() -> None:
    assert degrees([20.0] * 4 + [-160.0] + [20.0] * 4) == [20.0] * 9
    assert degrees([170.0, -170.0, 170.0, -170.0])[0] == pytest.approx(176.6, abs=0.1)


def test_no_report_or_contradicting_ones_give_no_yaw() -> None:
    assert degrees([]) == []
    nothing = degrees([np.nan] * 6 + [0.0])
    assert np.isnan(nothing[:4]).all()
    assert nothing[4:] == [0.0] * 3
    assert np.isnan(degrees([0.0, 180.0] * 4)).all()


def test_facings_of_a_person_who_goes_along_are_dropped() -> None:
    still = [50.0] * 5
    going = [50.0 + 20.0 * k for k in range(5)]
    sides = [100.0] * 5
    np.testing.assert_array_equal(
        facings_on_the_spot([0.5] * 5, still, sides, FPS), [0.5] * 5
    )
    # two seconds to either side count, so all five frames: 80 pixels, where 35 are too far
    assert np.isnan(facings_on_the_spot([0.5] * 5, going, sides, FPS)).all()
    # 87.5 are not
    np.testing.assert_array_equal(
        facings_on_the_spot([0.5] * 5, going, [250.0] * 5, FPS), [0.5] * 5
    )
    # a person who sets out with frame 21 is 40 pixels away in frame 22, which is two seconds after frame 14
    later = facings_on_the_spot([0.5] * 25, [50.0] * 20 + going, [100.0] * 25, FPS)
    assert np.flatnonzero(np.isnan(later)).tolist() == list(range(14, 25))
    np.testing.assert_array_equal(
        facings_on_the_spot([0.5] * 2, [np.nan] * 2, [0.0] * 2, FPS), [0.5] * 2
    )


def test_a_scene_has_the_yaws_that_a_segmenter_reports(
    filmed: tuple[Path, list[Any]], segmenter: Callable[..., None]
) -> None:
    segmenter("box", Box)
    camera = Camera.around(MIDDLE, 0.25, 5.0, (160, 120))
    scene = scene_of(
        [filmed[0]],
        SourceOptions(camera=(camera,), frames=(0, 6), extraction=Extraction("box")),
    )
    assert [observation.yaw for observation in scene.observations] == pytest.approx(
        [0.75] * 6
    )
    assert scene.yaw == pytest.approx(0.75)
    assert scene_of([filmed[0]], SourceOptions(camera=(camera,))).yaw is None


@pytest.mark.skipif(find_spec("mediapipe") is None, reason="without mediapipe")
def test_mediapipe_reports_the_facing_of_shoulders_and_hips() -> None:
    from posefit_mediapipe.segmenter import LEFT as LEFTS
    from posefit_mediapipe.segmenter import RIGHT as RIGHTS
    from posefit_mediapipe.segmenter import _facing

    def landmarks(x: float, z: float) -> Any:
        left = SimpleNamespace(x=x, z=z)
        right = SimpleNamespace(x=-x, z=-z)
        return SimpleNamespace(
            landmark={**dict.fromkeys(LEFTS, left), **dict.fromkeys(RIGHTS, right)}
        )

    # the left of a person who faces the camera is on the picture's right; of one who turns to its right, farther away
    assert _facing(landmarks(0.2, 0.0)) == 0.0
    assert _facing(landmarks(0.0, 0.2)) == pytest.approx(np.pi / 2)
    assert abs(_facing(landmarks(-0.2, 0.0))) == pytest.approx(np.pi)
    assert np.isnan(_facing(None))


@dataclass(frozen=True)
class Taken:
    """What a way to take the person out gave."""

    name: str
    warnings: tuple[str, ...] = ()


@each(
    ("doubts", "used"),
    [
        ((None,), "first"),
        ((Verdict("jumpy; more", False), None), "second"),
        ((Verdict("empty; more", True), None), "second"),
        ((Verdict("jumpy; more", False), Verdict("jumpy", False)), "first"),
        ((Verdict("empty; more", True), Verdict("jumpy", False)), "second"),
        ((Verdict("jumpy; more", False), Verdict("empty", True)), "first"),
    ],
)
def test_the_way_that_is_doubted_least_takes_the_person_out(
    doubts: tuple[Verdict | None, ...], used: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ways = [SimpleNamespace(name=name) for name in ("first", "second")]
    how = SimpleNamespace(ways=lambda cameras: ways)
    results = iter(zip(ways, doubts, strict=False))

    def taken_out(*_: Any) -> Any:
        way, doubt = next(results)
        if doubt is not None and doubt.refused:
            raise NoPersonError(doubt.text)
        return [SimpleNamespace(name=way.name, doubt="" if doubt is None else "jumpy")]

    monkeypatch.setattr(source, "Segmentation", lambda *_: None)
    monkeypatch.setattr(source, "_segmented", taken_out)
    taken = source._of_films(
        [None],
        [],
        how,
        (None, None),
        QUIET,
        lambda views: Taken(views[0].name),
    )
    assert taken.name == used
    assert bool(taken.warnings) == (used == "second")
    assert next(results, None) is None  # all that had to be tried were


def test_only_masks_without_the_person_have_another_way_tried(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    how = SimpleNamespace(ways=lambda cameras: [SimpleNamespace(name="a")] * 2)
    tried = []

    def taken_out(*_: Any) -> Any:
        tried.append(None)
        raise InputError("frames of another size")

    monkeypatch.setattr(source, "Segmentation", lambda *_: None)
    monkeypatch.setattr(source, "_segmented", taken_out)
    with pytest.raises(InputError, match="of another size"):
        source._of_films([None], [], how, (None, None), QUIET, None)
    assert len(tried) == 1


@each(
    ("left", "top", "around", "at"),
    [
        # by hand: 20 x 20 pixels and 10 more on each side; at the body 2 more, as 0.1 of 20 is
        (40, 30, 40 * 40, 24 * 24),
        # in a corner of the picture there is nothing to two of the sides
        (0, 0, 30 * 30, 22 * 22),
        (100, 80, 30 * 30, 22 * 22),
    ],
)
def test_moving_pixels_are_counted_around_the_person_and_on_the_body(
    left: int, top: int, around: int, at: int
) -> None:
    region = np.zeros((100, 120), dtype=bool)
    region[top : top + 20, left : left + 20] = True
    everything = np.ones_like(region)
    assert moved_pixels(everything, region, region, 20.0, 0.1) == (around, at)
    assert moved_pixels(~everything, region, region, 20.0, 0.1) == (0, 0)
