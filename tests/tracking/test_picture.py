"""Pictures of a track: faint limbs, another mode, lost frames."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS, PARENTS
from posefit.geometry.symmetry import mirrored_poses
from posefit.output import picture
from posefit.output.drawing import (
    BACKGROUND,
    BOTH,
    MISSED,
    OTHER,
    blank,
    draw_bones,
    side_camera,
    width_of,
    wrapped,
)
from posefit.output.picture import BORDER, LABEL_HEIGHT, PANEL, Painter, curve
from posefit.uncertainty.modes import Mode, Posterior
from tests.cases import each
from tests.tracking.scenes import exact_frames, walk


@pytest.fixture(scope="module")
def scene() -> Scene:
    return walk(1, size=(160, 120))


@pytest.fixture(scope="module")
def frame(scene: Scene) -> Frame:
    return exact_frames(scene)[0]


def row(**values: float) -> dict[str, float]:
    return {"cost": 0.0, "iou": 1.0, "unknown_sides": np.nan, "lost": np.nan, **values}


def painted(
    scene: Scene,
    frame: Frame,
    values: dict[str, float] | None = None,
    filmed: Any = None,
    radii: Array | None = None,
) -> Any:
    """Return the picture of the first frame, and how wide its left half is."""
    image = Painter(scene).add(
        frame, scene.observations[0], values or row(), filmed, radii
    )
    return image, image.shape[1] - PANEL


def pixels(image: Any, colour: tuple[int, int, int], close: int = 0) -> int:
    """Return how many pixels have a colour, or nearly."""
    return int(
        (np.abs(image.astype(int) - np.array(colour)).max(axis=2) <= close).sum()
    )


def test_an_uncertain_limb_is_drawn_faintly_on_and_next_to_the_masks(
    scene: Scene, frame: Frame
) -> None:
    plain, half = painted(scene, frame)
    np.testing.assert_array_equal(
        plain, painted(scene, frame, radii=np.full((3, 27), 0.02))[0]
    )
    radii = np.full((3, 27), 0.02)
    # of the 80 % interval
    radii[1, [JOINTS.index(name) for name in ("lfoot", "ltoes", "ltibia")]] = 0.5
    changed = (plain != painted(scene, frame, radii=radii)[0]).any(axis=2)
    for side in (changed[:, :half], changed[:, half:]):
        assert 0.002 < side.mean() < 0.2
        assert not side[: PANEL // 2].any()  # a leg
    radii[[0, 2]], radii[1] = 0.5, 0.02  # the other intervals do not count
    np.testing.assert_array_equal(painted(scene, frame, radii=radii)[0], plain)


@each(("weight", "drawn"), [(0.19, False), (0.2, False), (0.21, True), (0.7, True)])
def test_another_mode_is_drawn_if_it_has_over_a_fifth(
    scene: Scene, frame: Frame, weight: float, drawn: bool
) -> None:
    mirrored = mirrored_poses(scene.body.skeleton, frame.pose[None])[0]
    modes = [
        Mode(1.0 - weight, frame.pose, frame.translation),
        Mode(weight, mirrored, frame.translation),
    ]
    posterior = Posterior(
        frame.pose[None], frame.translation[None], np.ones(1), modes=modes
    )
    image, half = painted(scene, replace(frame, posterior=posterior))
    for part in (image[:, :half], image[: PANEL - 60, half:]):  # without the words
        assert (pixels(part, OTHER, close=12) > 100) == drawn


def test_the_summary_of_a_single_frame_has_each_pose_it_may_be_with_its_weight_and_no_curve(
    scene: Scene, frame: Frame, monkeypatch: pytest.MonkeyPatch
) -> None:
    words: list[str] = []
    monkeypatch.setattr(
        picture, "write", lambda image, text, *_, **__: words.append(text)
    )
    poses = frame.pose + 0.3 * np.arange(6)[:, None] * np.eye(len(frame.pose))[6]
    weights = (0.5, 0.2, 0.1, 0.08, 0.07, 0.02)
    modes = [
        Mode(weight, pose, frame.translation)
        for weight, pose in zip(weights, poses, strict=True)
    ]
    places = np.tile(frame.translation, (6, 1))
    posterior = Posterior(poses, places, np.array(weights), modes=modes)
    painter = Painter(scene)
    painter.add(replace(frame, posterior=posterior), scene.observations[0], row())
    height = painter.summary({"cost": np.zeros(1)}).shape[0]
    assert [text for text in words if "%" in text and "thin" not in text] == [
        "frame 0, cost 0.0, 50 %",
        "or this, 20 %",
        "or this, 10 %",
        "or this, 8 %",
    ]
    # two rows of stills, and the legend
    assert height == 2 * (PANEL // 2 + LABEL_HEIGHT) + LABEL_HEIGHT


@each(("lost", "marked"), [(np.nan, False), (0.49, False), (0.5, True), (1.0, True)])
def test_a_lost_frame_has_a_border(
    scene: Scene, frame: Frame, lost: float, marked: bool
) -> None:
    image, _ = painted(scene, frame, row(lost=lost))
    edges = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
    assert (edges == MISSED).all(axis=1).all() == marked
    if marked:
        inner = image[BORDER - 1 : BORDER + 1, BORDER:-BORDER]
        assert [bool((line == MISSED).all()) for line in inner] == [True, False]
    assert pixels(image[-40:, -PANEL + 12 : -PANEL + 120], MISSED) == 0 or marked


def test_a_pose_that_is_held_is_neither_lost_nor_of_unknown_sides(
    scene: Scene, frame: Frame, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = list[str]()
    monkeypatch.setattr(
        picture, "write", lambda image, text, *_, **__: words.append(text)
    )
    held = replace(scene.observations[0], usable=False)
    for observation in (scene.observations[0], held):
        words.clear()
        Painter(scene).add(frame, observation, row(lost=1.0, unknown_sides=1.0))
        searched = observation.usable
        assert ("lost" in words) == searched
        assert ("left and right unknown" in words) == searched
        assert any("pose held" in text for text in words) != searched


@each("azimuth", [0.0, 0.7, -2.0, 3.1])
def test_the_side_view_has_the_whole_body_from_the_right(
    scene: Scene, frame: Frame, azimuth: float
) -> None:
    camera = Camera.around(frame.translation, azimuth, 4.0, (160, 120))
    side = side_camera(scene.body, camera, frame.pose, frame.translation, 90)
    # it stands to the camera's right, and looks to the left
    np.testing.assert_allclose(side.rotation[2], -camera.rotation[0], atol=1e-9)
    joints = scene.body.skeleton.joints(frame.pose, frame.translation)
    pixels, depths = side.project(joints)
    assert depths.min() > 0.0
    # with room for the flesh about the joints; the middle of their box is in the middle
    assert pixels.min() > 4.0
    assert pixels.max() < 86.0
    height = pixels[:, 1]
    assert 0.5 * (height.min() + height.max()) == pytest.approx(45.0, abs=2.0)
    assert np.ptp(height) > 0.6 * 90


def test_lines_of_a_body_start_and_end_at_its_joints(
    scene: Scene, frame: Frame
) -> None:
    camera = scene.cameras[0]
    image = np.zeros((camera.height, camera.width, 3), dtype=np.uint8)
    draw_bones(image, scene.body, camera, frame.pose, frame.translation, BOTH)
    joints = scene.body.skeleton.joints(frame.pose, frame.translation)
    pixels, _ = camera.project(joints)
    drawn = np.zeros(image.shape[:2], dtype=bool)
    for joint, parent in enumerate(PARENTS[1:], 1):
        for share in np.linspace(0.0, 1.0, 50):
            x, y = pixels[parent] + share * (pixels[joint] - pixels[parent])
            # at least half of it
            assert image[int(y), int(x)].any(), (joint, share)
            drawn[int(y) - 3 : int(y) + 4, int(x) - 3 : int(x) + 4] = True
    assert not image[~drawn].any()


def test_empty_pictures_are_drawn_on_separately() -> None:
    first = blank(4, 6)
    first[:] = 0
    second = blank(4, 6)
    assert second.shape == (4, 6, 3)
    assert (second == BACKGROUND).all()


def test_a_long_note_is_broken_into_lines_of_one_size() -> None:
    note = "the picture's border cuts the mask above and below, and 3 more signs count against it"
    lines = wrapped(note, 300, 0.65)
    assert " ".join(lines) == note
    assert max(width_of(line, 0.65) for line in lines) <= 300
    assert all(
        width_of(f"{line} {more.split()[0]}", 0.65) > 300
        for line, more in pairwise(lines)
    )


def test_peaks_do_not_flatten_a_curve_and_are_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    texts: list[str] = []
    monkeypatch.setattr(
        picture, "write", lambda image, text, *_, **__: texts.append(text)
    )
    values = 4.0 + np.sin(np.arange(100.0))

    def highest(values: Array) -> int:
        """Return the row of the curve's highest pixel in the part that has no peak."""
        return int(
            np.flatnonzero(
                (curve(values, "cost", 600, 180, 50)[:, 320:] == BOTH)
                .all(axis=2)
                .any(axis=1)
            )[0]
        )

    calm = highest(values)
    assert texts[-1] == "cost, frame by frame: 0, mean and maximum"
    values[[10, 11, 30]] = [80.0, 90.0, 40.0]
    assert highest(values) < calm + 70  # of 180; 110 where the axis goes to 90
    assert (
        texts[-1]
        == "cost, frame by frame: 0, mean, and the top; above it 90.0 in frame 61, 40.0 in frame 80"
    )
