"""The calibration on the page of two cameras: films of a board are rendered, and the cameras come back."""

import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest

from posefit.arrays import Array
from posefit.geometry.calibration import read_calibrations
from tests.docs.pages import blocks, pages

# as on the page; pixels of a square in the board's own picture
COLUMNS = 8
ROWS = 5
SQUARE = 0.06
TEXEL = 60
SIZE = (1920, 1080)
MATRIX = np.array([[1650.0, 0.0, 960.0], [0.0, 1650.0, 540.0], [0.0, 0.0, 1.0]])
# metres from the middle of the board on the floor
EYES = np.array([[2.87, 0.89, 1.3], [0.51, 2.96, 1.3]])


def looking(eye: Array) -> tuple[Array, Array]:
    """Return the rotation and translation of a camera that looks at a place above the floor."""
    ahead = np.array([0.0, 0.0, 0.6]) - eye
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    axes = np.array(
        [one / np.linalg.norm(one) for one in (right, np.cross(ahead, right), ahead)]
    )
    return axes, -axes @ eye


def boards() -> list[tuple[Array, Array]]:
    """Return the board's axes and place: on the floor, then in a hand, tilted at random."""
    rng = np.random.default_rng(0)
    towards = np.array([*(EYES[0] + EYES[1])[:2], 0.6])
    across = np.cross([0.0, 0.0, 1.0], towards)
    facing = np.column_stack(
        [
            one / np.linalg.norm(one)
            for one in (across, np.cross(across, towards), -towards)
        ]
    )
    held = [facing @ cv2.Rodrigues(rng.uniform(-0.5, 0.5, 3))[0] for _ in range(12)]
    places = np.column_stack(
        [rng.uniform(-0.4, 0.4, (12, 2)), rng.uniform(0.3, 1.2, 12)]
    )
    return [(np.diag([1.0, -1.0, -1.0]), np.zeros(3)), *zip(held, places, strict=True)]


@pytest.mark.slow
def test_the_pages_calibration_gives_the_cameras_that_filmed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    squares = np.indices((ROWS + 1, COLUMNS + 1)).sum(axis=0) % 2 * 255
    picture = np.pad(
        np.kron(squares, np.ones((TEXEL, TEXEL))), TEXEL, constant_values=255
    ).astype(np.uint8)
    texels = np.array(
        [
            [SQUARE / TEXEL, 0.0, -2.0 * SQUARE],
            [0.0, SQUARE / TEXEL, -2.0 * SQUARE],
            [0.0, 0.0, 1.0],
        ]
    )
    for name, eye in zip("ab", EYES, strict=True):
        turn, move = looking(eye)
        writer = cv2.VideoWriter(
            f"board-{name}.mp4", cv2.VideoWriter.fourcc(*"mp4v"), 30.0, SIZE
        )
        for axes, place in boards():
            plane = MATRIX @ np.column_stack(
                [(turn @ axes)[:, :2], turn @ place + move]
            )
            shown = cv2.warpPerspective(picture, plane @ texels, SIZE, borderValue=128)
            for _ in range(10):
                writer.write(cv2.cvtColor(shown, cv2.COLOR_GRAY2BGR))
        writer.release()
    page = next(path for path in pages() if path.name == "two-cameras.md")
    code = next(
        block.text
        for block in blocks(page)
        if block.language == "python" and "calibrateCamera" in block.text
    )
    exec(compile(code, str(page), "exec"), {})
    assert [camera.name for camera in read_calibrations(tmp_path / "cameras.toml")] == [
        "a",
        "b",
    ]
    found = tomllib.loads((tmp_path / "cameras.toml").read_text("utf-8"))
    eyes = [
        -cv2.Rodrigues(np.array(found[k]["rotation"]))[0].T @ found[k]["translation"]
        for k in "ab"
    ]
    assert [eye[2] for eye in eyes] == pytest.approx([1.3, 1.3], abs=0.03)
    assert np.linalg.norm(eyes[1] - eyes[0]) == pytest.approx(
        np.linalg.norm(EYES[1] - EYES[0]), rel=0.02
    )
