"""The folder a track leaves behind: it appears whole under its name, or not at all."""

import csv
import json
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np

from posefit.fitting.tracker import Frame, Observation
from posefit.geometry.skeleton import JOINTS
from posefit.motion.motion import Motion
from posefit.study.picture import Painter
from posefit.study.source import Scene

FILES = (
    "poses.npz",
    "track.amc",
    "skeleton.asf",
    "camera.json",
    "frames.csv",
    "summary.json",
    "overlay.mp4",
    "summary.png",
)
_VIDEO_CODE = "mp4v"


class OutputFolder:
    """Writes beside the target and renames at the end. Raises ValueError where the target may not be written."""

    def __init__(self, path: str | Path, force: bool) -> None:
        self.path = Path(path)
        if self.path.exists() and not self.path.is_dir():
            raise ValueError(f"{self.path}: expected a folder to write to, got a file")
        if self.path.exists() and not force:
            raise ValueError(f"{self.path}: expected a new folder, got one that exists; --force replaces it")
        if self.path.exists():
            strange = sorted(entry.name for entry in self.path.iterdir() if entry.name not in FILES)
            if strange:
                raise ValueError(
                    f"{self.path}: expected a folder of earlier results to replace, got one with {strange[0]}"
                )
        self._painter: Painter | None = None
        self._video: Any = None

    def __enter__(self) -> Self:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._building = Path(tempfile.mkdtemp(prefix=f".{self.path.name}-", dir=self.path.parent))
        except OSError as error:
            raise ValueError(f"{self.path}: expected a place to write to, got {error.strerror}") from None
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if self._video is not None:
            self._video.release()
        if kind is None:
            self._building.chmod(0o755)
            if self.path.exists():
                old = Path(tempfile.mkdtemp(prefix=f".{self.path.name}-", dir=self.path.parent))
                self.path.rename(old / "old")
                self._building.rename(self.path)
                shutil.rmtree(old)
            else:
                self._building.rename(self.path)
        else:
            shutil.rmtree(self._building, ignore_errors=True)

    def picture(self, scene: Scene, frame: Frame, observation: Observation, row: Mapping[str, float]) -> None:
        """Add a frame to the overlay video."""
        import cv2

        if self._painter is None:
            self._painter = Painter(scene)
        image = self._painter.add(frame, observation, row)
        if self._video is None:
            size = (image.shape[1], image.shape[0])
            code = cv2.VideoWriter.fourcc(*_VIDEO_CODE)
            self._video = cv2.VideoWriter(str(self._building / "overlay.mp4"), code, scene.fps, size)
            if not self._video.isOpened():
                raise ValueError(f"{self.path}: expected OpenCV to write {_VIDEO_CODE} video, got a build that cannot")
        self._video.write(image)

    def finish(
        self, estimate: Motion, frames: Sequence[Frame], rows: Sequence[Mapping[str, float]], summary: Mapping[str, Any]
    ) -> None:
        """Write everything but the video."""
        import cv2

        from posefit.motion.amc import write_amc
        from posefit.motion.asf import write_asf

        assert self._painter is not None
        folder = self._building
        np.savez_compressed(
            folder / "poses.npz",
            poses=estimate.poses,
            translations=estimate.translations,
            fps=np.array(estimate.fps),
            joints=np.array(JOINTS),
            costs=np.array([frame.cost for frame in frames]),
        )
        write_asf(folder / "skeleton.asf", estimate.skeleton)
        write_amc(folder / "track.amc", estimate)
        (folder / "camera.json").write_text(self._painter.camera.to_json(), encoding="utf-8")
        with (folder / "frames.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
        (folder / "summary.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
        cv2.imwrite(str(folder / "summary.png"), self._painter.summary(rows))
