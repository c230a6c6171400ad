"""What pictures of a track show of how sure it is: faint limbs, another mode, lost frames, bands and marks over time."""

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene, synthetic
from posefit.geometry.skeleton import JOINTS
from posefit.geometry.symmetry import mirrored_poses
from posefit.motion import built_in
from posefit.tracking.drawing.body import FAINTEST, draw_body, opacities, solid_map
from posefit.tracking.drawing.chart import HEAD, LEFT_MARGIN, RIGHT_MARGIN, doubts
from posefit.tracking.drawing.colours import BACKGROUND, BOTH, MISSED, OTHER, RIGHT
from posefit.tracking.picture import PANEL, Painter
from posefit.uncertainty.modes import Mode
from tests.cases import each
from tests.tracking.test_evaluation import frame_of

FRAMES = 7
WIDTH, HEIGHT = 700, 240


@pytest.fixture(scope="module")
def scene() -> Scene:
    return synthetic(built_in.motion("walk", frames=FRAMES), [45.0], (160, 120), [], (None, None))


def right(scene: Scene, k: int = 0, **said: Any) -> Frame:
    assert scene.truth is not None
    return replace(frame_of(scene, scene.truth.poses[k], scene.truth.translations[k], scene.observations[k]), **said)


def row(**said: float) -> dict[str, float]:
    return {"cost": 0.0, "iou": 1.0, "unknown_sides": np.nan, "lost": np.nan, **said}


def pixels(image: Any, colour: tuple[int, int, int], close: int = 0) -> int:
    """Return how many pixels have a colour, or nearly."""
    return int((np.abs(image.astype(int) - np.array(colour)).max(axis=2) <= close).sum())


@each(
    ("usable", "wanted"),
    [
        ([True] * 7, [0, 1, 2, 4, 5, 6]),
        ([False, False, True, True, False, True, False], [2, 3, 5]),
        ([False] * 7, [0, 1, 2, 4, 5, 6]),  # there is nothing better
    ],
)
def test_stills_are_of_frames_that_show_the_person(scene: Scene, usable: list[bool], wanted: list[int]) -> None:
    painter, kept = Painter(scene, usable), []
    for k in range(FRAMES):
        before = len(painter._stills)
        painter.add(right(scene, k), scene.observations[k], row())
        kept += [k] * (len(painter._stills) - before)
    assert kept == wanted


def test_a_bone_is_as_solid_as_the_less_sure_of_its_ends() -> None:
    radii = np.zeros(len(JOINTS))
    radii[JOINTS.index("lfoot")] = 0.175  # halfway from 5 to 30 cm
    radii[JOINTS.index("rhand")] = 2.0
    solid = dict(zip(JOINTS[1:], opacities(radii), strict=True))
    assert solid.pop("lfoot") == solid.pop("ltoes") == pytest.approx(0.5)
    assert solid.pop("rhand") == FAINTEST
    assert set(solid.values()) == {1.0}
    assert opacities(np.full(len(JOINTS), np.nan)).tolist() == [1.0] * 26


@each("solid", [0.0, 0.25, 1.0])
def test_what_lies_behind_shows_through_a_faint_body(scene: Scene, solid: float) -> None:
    frame, (camera,) = right(scene), scene.cameras
    behind = np.random.default_rng(0).integers(0, 255, (camera.height, camera.width, 3)).astype(np.uint8)
    drawn, faint = behind.copy(), behind.copy()
    draw_body(drawn, scene.body, camera, frame.pose, frame.translation)
    draw_body(faint, scene.body, camera, frame.pose, frame.translation, np.full(26, solid))
    if solid == 0.0:
        np.testing.assert_array_equal(faint, behind)
    elif solid == 1.0:
        np.testing.assert_array_equal(faint, drawn)
    else:  # what one bone alone covers is three parts of what was there; where several lie, there is more of them
        middle, one = faint.astype(float), 0.25 * drawn + 0.75 * behind
        assert (np.abs(middle - one).max(axis=2) <= 1.0)[(drawn != behind).any(axis=2)].mean() > 0.3
        assert (faint != drawn).any()


def test_pixels_are_as_solid_as_the_limb_in_front(scene: Scene) -> None:
    frame, (camera,) = right(scene), scene.cameras
    each = np.full(26, 0.6)
    share = solid_map(scene.body, camera, frame.pose, frame.translation, each)
    assert set(np.unique(share).round(6)) == {0.6, 1.0}
    mask = scene.observations[0].silhouettes[0].mask
    assert (share[mask] < 1.0).mean() > 0.95
    assert (share[~mask] < 1.0).mean() < 0.05


def test_an_unsure_limb_fades_on_the_masks_and_beside_them(scene: Scene) -> None:
    plain = Painter(scene).add(right(scene), scene.observations[0], row())
    sure = Painter(scene).add(right(scene), scene.observations[0], row(), radii=np.full((3, 27), 0.02))
    np.testing.assert_array_equal(plain, sure)
    radii = np.full((3, 27), 0.02)
    radii[1, [JOINTS.index(name) for name in ("lfoot", "ltoes", "ltibia")]] = 0.5  # of the 80 % interval
    faint = Painter(scene).add(right(scene), scene.observations[0], row(), radii=radii)
    changed = (plain != faint).any(axis=2)
    half = plain.shape[1] - PANEL
    for side in (changed[:, :half], changed[:, half:]):
        assert 0.002 < side.mean() < 0.2
        assert not side[: PANEL // 2].any()  # a leg
    radii[[0, 2]], radii[1] = 0.5, 0.02  # the other intervals do not count
    np.testing.assert_array_equal(Painter(scene).add(right(scene), scene.observations[0], row(), radii=radii), plain)


@each(("weight", "drawn"), [(0.19, False), (0.2, False), (0.21, True), (0.7, True)])
def test_another_mode_is_drawn_where_it_has_more_than_a_fifth(scene: Scene, weight: float, drawn: bool) -> None:
    frame = right(scene)
    mirrored = mirrored_poses(scene.body.skeleton, frame.pose[None])[0]
    modes = [Mode(1.0 - weight, frame.pose, frame.translation), Mode(weight, mirrored, frame.translation)]
    image = Painter(scene).add(replace(frame, modes=modes), scene.observations[0], row())
    half = image.shape[1] - PANEL
    for part in (image[:, :half], image[: PANEL - 60, half:]):  # not what is written
        assert (pixels(part, OTHER, close=12) > 100) == drawn


def test_a_mode_is_drawn_on_what_was_filmed_too(scene: Scene) -> None:
    frame, film = right(scene), np.zeros((120, 160, 3), np.uint8)
    mirrored = mirrored_poses(scene.body.skeleton, frame.pose[None])[0]
    modes = [Mode(0.5, frame.pose, frame.translation), Mode(0.5, mirrored, frame.translation)]
    plain = Painter(scene).add(frame, scene.observations[0], row(), film)
    image = Painter(scene).add(replace(frame, modes=modes), scene.observations[0], row(), film, np.full((3, 27), 0.4))
    half = image.shape[1] - PANEL
    assert pixels(image[:, :half], OTHER) > 100
    assert pixels(plain[:, :half], OTHER) == 0
    assert image[:, :half].mean() < plain[:, :half].mean()  # fainter
    assert not film.any()


@each(("lost", "marked"), [(np.nan, False), (0.49, False), (0.5, True), (1.0, True)])
def test_a_lost_frame_has_a_border(scene: Scene, lost: float, marked: bool) -> None:
    image = Painter(scene).add(right(scene), scene.observations[0], row(lost=lost))
    edges = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
    assert (edges == MISSED).all(axis=1).all() == marked
    assert pixels(image[-40:, -PANEL + 12 : -PANEL + 120], MISSED) == 0 or marked


def test_unknown_sides_are_said(scene: Scene) -> None:
    for value, said in ((1.0, True), (0.0, False), (np.nan, False)):
        image = Painter(scene).add(right(scene), scene.observations[0], row(unknown_sides=value))
        assert (pixels(image[-40:], OTHER, close=12) > 20) == said


def test_the_summary_has_a_chart_of_doubts_where_somebody_says_any(scene: Scene) -> None:
    def heights(rows: list[dict[str, float]], radii: Any = None) -> int:
        painter = Painter(scene)
        for k, one in enumerate(rows):
            painter.add(right(scene, k), scene.observations[k], one)
        return int(painter.summary(rows, radii, "left and right: unknown in 1 of 7 frames").shape[0])

    without = heights([row()] * FRAMES)
    assert heights([row(lost=0.0)] * FRAMES) == without + HEIGHT
    assert heights([row()] * FRAMES, np.full((FRAMES, 3, 27), 0.1)) == without + HEIGHT


def columns(count: int = FRAMES) -> Any:
    return np.rint(np.linspace(LEFT_MARGIN, WIDTH - RIGHT_MARGIN, count)).astype(int)


def test_frames_are_marked_where_they_are() -> None:
    rows = [row(unknown_sides=float(k in (2, 3)), lost=0.9 if k == 5 else 0.1) for k in range(FRAMES)]
    image = doubts(rows, None, "told", WIDTH, HEIGHT)[HEIGHT - 50 :]
    at = columns()
    assert [bool(pixels(image[:, x : x + 1], OTHER)) for x in at] == [k in (2, 3) for k in range(FRAMES)]
    assert [bool(pixels(image[:, x : x + 1], MISSED)) for x in at] == [k == 5 for k in range(FRAMES)]


def test_bands_are_as_high_as_intervals_are_wide_and_have_gaps_where_nobody_says() -> None:
    radii = np.tile(np.array([0.05, 0.1, 0.2])[:, None], (FRAMES, 1, 27))
    radii[:, :, 0] = 9.0  # of the root, which every interval is relative to
    radii[4] = np.nan
    image = doubts([row()] * FRAMES, radii, "", WIDTH, HEIGHT)
    shades = [
        tuple(round(s * c + (1 - s) * b) for c, b in zip(RIGHT, BACKGROUND, strict=True)) for s in (0.85, 0.5, 0.25)
    ]
    high = HEIGHT - 50 - HEAD
    for k, x in enumerate(columns()):
        column = image[HEAD:, x + 2 if k < FRAMES - 1 else x - 2][:, None]
        counts = [pixels(column, shade, close=1) for shade in shades]
        if k == 4:
            assert counts == [0, 0, 0]
            continue
        # 50, 50 and 100 of 210 mm, but for the lines across
        np.testing.assert_allclose(counts, high * np.array([50, 50, 100]) / 210, atol=5)


def test_the_true_error_is_a_line_among_the_bands() -> None:
    rows = [row(mpjpe_mm=100.0)] * FRAMES
    image = doubts(rows, np.full((FRAMES, 3, 27), 0.2), "", WIDTH, HEIGHT)
    line = np.flatnonzero(np.abs(image[HEAD:, WIDTH // 2].astype(int) - BOTH).max(axis=1) < 20)
    assert line.mean() == pytest.approx((HEIGHT - 50 - HEAD) * (1 - 100 / 210), abs=2)


@each("count", [1, 2])
def test_a_single_frame_has_its_chart(count: int) -> None:
    rows = [row(unknown_sides=1.0, lost=1.0, mpjpe_mm=40.0)] * count
    image = doubts(rows, np.full((count, 3, 27), 0.1), "", WIDTH, HEIGHT)
    assert image.shape == (HEIGHT, WIDTH, 3)
    assert pixels(image[-50:], OTHER) > 1000
    assert pixels(image[-50:], MISSED) > 1000
    assert cv2.imencode(".png", image)[0]
