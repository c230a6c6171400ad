"""Films in the layouts of KTH's actions, HumanEva-I and CMU's database, made here."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

import footage_figures
from footage_figures import (
    LABELS,
    SINGLE,
    TALL,
    TRACKED,
    filmed_scene,
    main,
    recording_of,
)
from posefit import Body, Camera, Motion
from posefit.motion import built_in
from posefit.motion.asf import write_asf
from posefit.output.drawing import draw_body
from tests.cases import each

SIZE = (160, 120)
Write = Callable[[Path, Motion], Path]
# HumanEva's world from ours
Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def walk(frames: int) -> Motion:
    return built_in.motion("walk", frames=frames, fps=25.0)


def side(motion: Motion) -> Camera:
    middle = motion.joints.reshape(-1, 3).mean(axis=0)
    return Camera.around(middle, float(motion.poses[0, 0]) + 1.4, 4.0, SIZE)


def write_film(path: Path, motion: Motion, before: int = 0) -> Path:
    """Write a person against a still background, after so many frames without them."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(0)
    camera = side(motion)
    body = Body.of(motion.skeleton)
    plain = cv2.GaussianBlur(
        rng.uniform(0, 255, (SIZE[1], SIZE[0], 3)).astype(np.uint8), (0, 0), 3
    )
    writer = cv2.VideoWriter(
        str(path), cv2.VideoWriter.fourcc(*"MJPG"), motion.fps, SIZE
    )
    for k in range(-before, len(motion)):
        image = plain.copy()
        if k >= 0:
            draw_body(image, body, camera, motion.poses[k], motion.translations[k])
        writer.write(image)
    writer.release()
    return path


def write_humaneva(root: Path, motion: Motion) -> Path:
    camera = side(motion)
    calibration = root / "S1" / "Calibration_Data" / "C1.cal"
    calibration.parent.mkdir(parents=True)
    rotation = camera.rotation @ Z_UP.T
    numbers = [
        *camera.focal,
        *(camera.centre - 0.5),
        0.0,
        *np.zeros(5),
        *rotation.ravel(),
        *(1e3 * camera.translation),
    ]
    calibration.write_text("\n".join(f"{value:.9f}" for value in numbers))
    return write_film(root / "S1" / "Image_Data" / "Walking_1_(C1).avi", motion)


def write_kth(root: Path, motion: Motion) -> Path:
    ranges = f"31-{30 + len(motion)}, 900-910"
    (root / "00sequences.txt").write_text(
        f"training: person 11\nperson01_walking_d1\tframes\t{ranges}\n"
    )
    return write_film(
        root / "walking" / "person01_walking_d1_uncomp.avi", motion, before=30
    )


def write_cmu(root: Path, motion: Motion) -> Path:
    film = write_film(root / "16" / "16_15.avi", motion)
    write_asf(root / "16" / "16.asf", motion.skeleton)
    return film


@each(
    ("write", "name", "activity", "frames"),
    [
        (write_kth, "person01_walking_d1", "walk", (30, 34)),
        (write_humaneva, "S1_Walking_1_C1", "walk", (5, None)),
        (write_cmu, "16_15", None, (None, None)),
    ],
)
def test_the_films_of_each_layout(
    write: Write, name: str, activity: str | None, frames: Any, tmp_path: Path
) -> None:
    recording = recording_of(write(tmp_path, walk(4)))
    assert (recording.name, recording.activity, recording.frames) == (
        name,
        activity,
        frames,
    )
    assert (recording.calibration is not None) == (write is write_humaneva)
    assert (recording.skeleton is not None) == (write is write_cmu)


@each(
    ("write", "spoilt", "content", "words"),
    [
        (
            write_kth,
            "00sequences.txt",
            None,
            "00sequences.txt: no such file",
        ),
        (
            write_kth,
            "00sequences.txt",
            "-",
            "expected a line such as 'person01_walking_d1 frames 1-75, 120-190'",
        ),
        (
            write_humaneva,
            "S1/Calibration_Data/C1.cal",
            None,
            "C1.cal: no such file",
        ),
        (
            write_humaneva,
            "S1/Calibration_Data/C1.cal",
            "500 500 80 60",
            "C1.cal: expected 22 numbers",
        ),
        (
            write_humaneva,
            "S1/Calibration_Data/C1.cal",
            "1 " * 22,
            "C1.cal: expected 22 numbers",
        ),
        (write_cmu, "16/16.asf", None, "16.asf: no such file"),
        (
            write_cmu,
            "16/notes",
            "",
            "--activity must be given for films with names that do not state it",
        ),
    ],
)
def test_a_missing_file_is_reported_in_one_line(
    write: Write, spoilt: str, content: Any, words: str, tmp_path: Path
) -> None:
    film = write(tmp_path, walk(3))
    (tmp_path / spoilt).unlink() if content is None else (tmp_path / spoilt).write_text(
        content
    )
    result = CliRunner(env={"POSEFIT_CMU": ""}).invoke(
        main, [str(film), "--out", str(tmp_path / "out")]
    )
    assert (result.exit_code, result.stdout) == (2, ""), result.output
    assert words in result.stderr
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_calibrated_film_is_seen_by_the_camera_that_filmed_it(tmp_path: Path) -> None:
    motion = walk(40)
    scene, first = filmed_scene(recording_of(write_humaneva(tmp_path, motion)))
    assert (first, scene.count) == (5, 35)
    joints = motion.joints[first]
    np.testing.assert_allclose(
        scene.cameras[0].project(joints)[0], side(motion).project(joints)[0], atol=1e-4
    )


@pytest.mark.slow
def test_a_film_gives_figures_8_and_10(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(footage_figures, "ITERATIONS", 20)
    words = [str(write_humaneva(tmp_path, walk(40))), "--out", str(tmp_path / "out")]
    result = CliRunner(env={"POSEFIT_CMU": ""}).invoke(
        main, words, catch_exceptions=False
    )
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith(
        "S1_Walking_1_C1: walk, frames 5 to 39, camera given\n"
    )
    lines = (tmp_path / "out" / "S1_Walking_1_C1.md").read_text().splitlines()[2:]
    rows = {line.split(" | ")[0].strip("| "): line.split(" | ") for line in lines}
    assert list(rows) == [LABELS[name] for name in (SINGLE, *TRACKED)]
    assert all(float(row[3]) > 0.5 for row in rows.values())
    for figure, count in (("figure-8", 2), ("figure-10", 5)):
        image = cv2.imread(str(tmp_path / "out" / f"{figure}-S1_Walking_1_C1.jpg"))
        assert image is not None
        assert image.shape == (count * TALL, 6 * TALL, 3)
