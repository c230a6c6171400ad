"""Pixels that are not square, and pictures of another size than their calibration's: what becomes of them, and what is said."""

import io
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from posefit.errors import InputError
from posefit.footage.options import SourceOptions
from posefit.footage.scene import Scene
from posefit.footage.source import scene_of
from posefit.geometry.body import Body
from posefit.geometry.calibration import Calibration
from posefit.geometry.camera import Camera
from posefit.progress import Progress
from posefit.silhouette.cost import BETA, areas, mismatch, pose_costs, project
from posefit.silhouette.mask import Silhouette, coarser_camera
from posefit.tracking.live import track_live
from tests.cases import each
from tests.files import arrays
from tests.footage.conftest import stack, walk
from tests.footage.test_footage import toml

FINE = (640, 480)
AT = range(10, 14)  # frames


def usual(azimuth: float = 0.8) -> Camera:
    return Camera.around(np.array([0.0, 0.9, 0.0]), azimuth, 4.0, FINE)


def squeezed(camera: Camera, across: int, down: int) -> tuple[Camera, list[Any]]:
    """Return the camera of every so-many-th column and row of a camera's pictures, and what it sees of a walk."""
    motion = walk()
    body = Body.of(motion.skeleton)
    by = np.array([across, down])
    first = by // 2
    masks = [
        project(body, camera, motion.poses[k], motion.translations[k])[
            first[1] :: down, first[0] :: across
        ]
        for k in AT
    ]
    size = masks[0].shape[::-1]
    # the middle of a pixel of these is the middle of one of those
    centre = (camera.centre - first - 0.5) / by + 0.5
    return replace(
        camera,
        width=size[0],
        height=size[1],
        focal=camera.focal / by,
        centre=centre,
    ), masks


def costs_of_the_truth(scene: Scene, motion: Any) -> Any:
    body = Body.of(motion.skeleton)
    return [
        pose_costs(
            body,
            scene.cameras,
            scene.observations[k].silhouettes,
            motion.poses[at][None],
            motion.translations[at][None],
        )[0][0]
        for k, at in enumerate(AT)
    ]


def test_a_camera_of_square_pixels_sees_the_same_in_more_columns_or_rows() -> None:
    camera = replace(usual(), focal=np.array([300.0, 600.0]))
    square = camera.squared()
    assert (square.width, square.height, square.square) == (1280, 480, True)
    np.testing.assert_array_equal(square.focal, 600.0)
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 3))
    # a column becomes two
    np.testing.assert_allclose(
        square.project(points)[0], camera.project(points)[0] * [2.0, 1.0], rtol=1e-12
    )
    assert square.squared() is square
    # what a board leaves open is not worth other pixels
    almost = replace(camera, focal=np.array([600.0, 602.0]))
    assert almost.squared() is almost


@each(("across", "down"), [(2, 1), (1, 2), (4, 1), (1, 4), (3, 2)])
def test_the_true_pose_costs_little_as_pixels_become_square(
    tmp_path: Path, across: int, down: int
) -> None:
    camera, masks = squeezed(usual(), across, down)
    calibration = toml(tmp_path / "one.toml", camera)
    assert not camera.square
    with pytest.raises(InputError, match=r"square pixels, .* Camera.squared\(\)"):
        pose_costs(Body.of(walk().skeleton), [camera], [], np.zeros((1, 66)), np.zeros((1, 3)))  # fmt: skip
    path = stack(tmp_path / "a.npz", masks, fps=25.0)
    motion = walk()
    body = Body.of(motion.skeleton)
    # of bodies that are drawn by discs where ellipses are seen
    by_discs = [
        mismatch(
            areas(
                body,
                camera,
                Silhouette.of(mask),
                motion.poses[k][None],
                motion.translations[k][None],
            ),
            BETA,
        )[0]
        for mask, k in zip(masks, AT, strict=True)
    ]
    for known in (camera, calibration):
        scene = scene_of([path], SourceOptions(camera=[known], up="y", height=1.7))
        (own,) = scene.cameras
        assert own.square
        np.testing.assert_allclose(own.focal, camera.focal.max())
        assert scene.observations[0].silhouettes[0].size == (own.width, own.height)
        said = [guess for guess in scene.guesses if "not square" in guess]
        assert len(said) == 1
        assert said[0].endswith(
            f"{camera.width}x{camera.height} becomes {own.width}x{own.height}"
        )
        assert np.mean(costs_of_the_truth(scene, motion)) < 0.5 * np.mean(by_discs)


def test_pal_dv_and_a_bent_lens_become_square_at_once(tmp_path: Path) -> None:
    # 720 x 576 whose pixels are 16 / 15 as wide as high
    camera = replace(usual(), focal=usual().focal * [15.0 / 16.0, 1.0])
    calibration = replace(
        Calibration.of(camera, "dv"), distortion=np.array([0.1, 0.0, 0.0, 0.0])
    )
    motion = walk()
    body = Body.of(motion.skeleton)
    straight = usual()
    masks = []
    for k in AT:
        seen = project(body, straight, motion.poses[k], motion.translations[k])
        # each bent pixel looks up its place in pictures of square pixels
        x, y = np.meshgrid(np.arange(FINE[0]), np.arange(FINE[1]))
        bent = np.stack([x, y, np.ones_like(x)], axis=-1) + [0.5, 0.5, 0.0]
        places = calibration.straightened(bent, FINE, straight)[..., :2] - 0.5
        masks.append(
            cv2.remap(
                seen.astype(np.uint8),
                places.astype(np.float32),
                None,
                cv2.INTER_NEAREST,
            )
        )
    scene = scene_of(
        [stack(tmp_path / "a.npz", masks)],
        SourceOptions(camera=[calibration], height=1.7),
    )
    (own,) = scene.cameras
    assert (own.width, own.height) == (round(640 * 16 / 15), 480)
    assert np.mean(costs_of_the_truth(scene, motion)) < 1.5
    silhouette = scene.observations[0].silhouettes[0]
    assert not silhouette.valid.all()


def test_landmarks_and_pictures_have_square_pixels(tmp_path: Path) -> None:
    camera, masks = squeezed(usual(), 2, 1)
    motion = walk()
    points = motion.joints[AT[0]]
    seen = camera.project(points)[0]
    landmarks = np.repeat(
        np.column_stack([seen, np.ones(len(seen))])[None], len(masks), axis=0
    )
    path = stack(tmp_path / "a.npz", masks, landmarks=landmarks)
    scene = scene_of([path], SourceOptions(camera=[camera], height=1.7))
    found = scene.observations[0].landmarks
    assert found is not None
    np.testing.assert_allclose(
        found[0, :, :2], scene.cameras[0].project(points)[0], atol=1e-6
    )


def test_a_stream_of_pixels_that_are_not_square_is_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera, masks = squeezed(coarser_camera(usual(), 2), 2, 1)
    pages = b"".join(
        b"P5\n%d %d\n255\n" % mask.shape[::-1] + (255 * mask.astype(np.uint8)).tobytes()
        for mask in masks
    )
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(pages)))
    messages: list[str] = []
    frames = list(
        track_live(
            camera=(toml(tmp_path / "one.toml", camera),),
            up="y",
            evaluations=40,
            restarts=0,
            progress=Progress(messages.append),
        )
    )
    assert frames
    assert any("pixels are not square" in message for message in messages)


def test_a_known_motion_is_drawn_with_square_pixels(tmp_path: Path) -> None:
    camera = replace(usual(), focal=np.array([300.0, 600.0]))
    for known in (camera, toml(tmp_path / "one.toml", camera)):
        scene = scene_of(["walk"], SourceOptions(camera=[known], up="y", frames=(0, 1)))
        assert scene.cameras[0].square
        size = scene.cameras[0].width, scene.cameras[0].height
        assert scene.observations[0].silhouettes[0].size == size == (1280, 480)


@each(
    ("stated", "said"),
    [
        ((640, 480), []),
        # scaled
        ((1280, 960), ["the calibration 'cam0' of 1280x960 is scaled to 640x480"]),
        ((320, 240), ["the calibration 'cam0' of 320x240 is scaled to 640x480"]),
        # filled up by a codec
        (
            (640, 470),
            ["the calibration 'cam0' of 640x470 is used for 640x480, with more or fewer rows or columns at the end"],
        ),
    ],
)  # fmt: skip
def test_pictures_of_another_size_are_scaled_or_cropped_with_a_note(
    tmp_path: Path, stated: tuple[int, int], said: list[str]
) -> None:
    camera = usual()
    padded = abs(stated[1] - 480) < 16 and stated[0] == 640
    scale = 1.0 if padded else stated[0] / 640.0
    made = replace(
        camera,
        width=stated[0],
        height=stated[1],
        focal=scale * camera.focal,
        centre=scale * camera.centre,
    )
    motion = walk()
    body = Body.of(motion.skeleton)
    masks = [project(body, camera, motion.poses[k], motion.translations[k]) for k in AT]
    scene = scene_of(
        [stack(tmp_path / "a.npz", masks)],
        SourceOptions(camera=[toml(tmp_path / "one.toml", made)], up="y", height=1.7),
    )
    assert [guess for guess in scene.guesses if "calibration 'cam0'" in guess] == said
    np.testing.assert_allclose(scene.cameras[0].focal, camera.focal, rtol=1e-9)
    np.testing.assert_allclose(scene.cameras[0].centre, camera.centre, rtol=1e-9)


def test_pictures_of_another_shape_are_refused(tmp_path: Path) -> None:
    made = replace(usual(), width=640, height=360, centre=np.array([320.0, 180.0]))
    path = stack(tmp_path / "a.npz", [np.eye(480, 640, dtype=bool)] * 2)
    with pytest.raises(InputError, match="'cam0' must be calibrated for 640x480, the size of the pictures, got 640x360"):  # fmt: skip
        scene_of([path], SourceOptions(camera=[toml(tmp_path / "one.toml", made)]))


def test_files_of_stretched_masks_have_the_cameras_square_pixels(
    tmp_path: Path,
) -> None:
    import posefit
    from posefit.progress import QUIET

    camera, masks = squeezed(coarser_camera(usual(), 2), 2, 1)
    out = tmp_path / "out"
    track = posefit.track(
        np.array(masks),
        camera=camera,
        method="random@pca",
        train=["walk-a"],
        evaluations=40,
        body_frames=0,
        restarts=0,
        out=out,
        progress=QUIET,
    )
    written = Camera.from_json(out / "camera.json")
    assert (written.width, written.height, written.square) == (320, 240, True)
    assert track.summary["size_pixels"] == [320, 240]
    assert len(arrays(out / "poses.npz")["poses"]) == len(masks)
