"""The calibration on the page of two cameras: films of a board are rendered, and the cameras come back."""

import tomllib
from pathlib import Path

import cv2
import numpy as np
import pytest

from posefit.geometry.calibration import read_calibrations
from tests.docs.films import EYES, write_boards
from tests.docs.pages import blocks, pages


@pytest.mark.slow
def test_the_pages_calibration_gives_the_cameras_that_filmed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_boards(tmp_path)
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
    cameras = tomllib.loads((tmp_path / "cameras.toml").read_text("utf-8"))
    eyes = []
    for name in "ab":
        camera = cameras[name]
        rotation = cv2.Rodrigues(np.array(camera["rotation"]))[0]
        eyes.append(-rotation.T @ camera["translation"])
    assert [eye[2] for eye in eyes] == pytest.approx([1.3, 1.3], abs=0.03)
    assert np.linalg.norm(eyes[1] - eyes[0]) == pytest.approx(
        np.linalg.norm(EYES[1] - EYES[0]), rel=0.02
    )
