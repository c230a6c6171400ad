"""The kinds of source: how the same small footage, or motion, is written as each of them.

A line of `MASKS` is a function of a folder and masks (T, H, W), one of `FILMS` of a folder and pictures (T, H, W, 3), and
one of `MOTIONS` of a folder and a motion. Each returns what `posefit.track` takes. One of `STREAMS` is a function of
masks and pictures, and returns the frames that come.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

import posefit
from posefit.footage.live import LiveImage
from posefit.motion.amc import write_amc
from posefit.motion.asf import write_asf
from posefit.motion.bvh import write_bvh
from posefit.silhouette.cost import project

SIZE = (96, 72)
COUNT = 8
FPS = 25.0
# the cheapest there is
QUICK: dict[str, Any] = {
    "method": "random@loose",
    "evaluations": 40,
    "restarts": 0,
    "body_frames": 0,
}


def camera(azimuth: float = 1.2) -> posefit.Camera:
    """Return a camera that sees the whole walk."""
    return posefit.Camera.around(np.array([0.0, 0.95, 0.0]), azimuth, 4.0, SIZE)


@cache
def walk() -> posefit.Motion:
    """Return a short walk about the origin."""
    motion = posefit.load_motion("walk", FPS).frames(0, COUNT)
    places = motion.translations - motion.translations.mean(axis=0) * [1, 0, 1]
    return posefit.Motion(
        motion.name, motion.skeleton, motion.poses, places, motion.fps
    )


@cache
def masks(azimuth: float = 1.2) -> Any:
    """Return the masks (T, H, W) of the walk."""
    motion = walk()
    body = posefit.Body.of(motion.skeleton)
    poses = zip(motion.poses, motion.translations, strict=True)
    drawn = [project(body, camera(azimuth), pose, place) for pose, place in poses]
    return np.array(drawn)


def background() -> Any:
    """Return a picture (H, W, 3) of a place in many colours."""
    rng = np.random.default_rng(0)
    coarse = rng.integers(60, 250, (9, 12, 3)).astype(np.uint8)
    return cv2.resize(coarse, SIZE, interpolation=cv2.INTER_CUBIC)


def pictures(shown: Any) -> Any:
    """Return pictures (T, H, W, 3) of a person in dark clothes before the background."""
    images = np.repeat(background()[None], len(shown), axis=0)
    images[shown] = (30, 20, 25)
    return images


def _images(folder: Path, images: Sequence[Any]) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"f{number:04d}.png" for number in range(len(images))]
    for file, image in zip(files, images, strict=True):
        assert cv2.imwrite(str(file), image)
    return files


def _white(shown: Any) -> list[Any]:
    return [255 * mask.astype(np.uint8) for mask in shown]


def _folder(folder: Path, images: Sequence[Any]) -> Path:
    return _images(folder, images)[0].parent


def _pages(folder: Path, images: Sequence[Any], suffix: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    first, *others = (Image.fromarray(image) for image in images)
    path = folder / f"pages{suffix}"
    first.save(path, save_all=True, append_images=others)
    return path


def _npz(folder: Path, shown: Any) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    np.savez(folder / "m.npz", masks=shown)
    return folder / "m.npz"


def _npy(folder: Path, shown: Any) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    np.save(folder / "m.npy", shown)
    return folder / "m.npy"


class Tensor:
    """An array of another library, which NumPy can read."""

    def __init__(self, values: Any) -> None:
        self._values = np.asarray(values)

    def __array__(self, dtype: Any = None, copy: Any = None) -> Any:
        return self._values if dtype is None else self._values.astype(dtype)

    def __len__(self) -> int:
        return len(self._values)

    def tolist(self) -> Any:
        return self._values.tolist()

    def item(self) -> Any:
        return self._values.item()


Written = Callable[[Path, Any], Any]
MASKS: dict[str, Written] = {
    "folder": lambda folder, shown: _folder(folder, _white(shown)),
    "folder as text": lambda folder, shown: str(_folder(folder, _white(shown))),
    "list": lambda folder, shown: _images(folder, _white(shown)),
    "list of texts": lambda folder, shown: [
        str(file) for file in _images(folder, _white(shown))
    ],
    "tuple": lambda folder, shown: tuple(_images(folder, _white(shown))),
    "list of lists": lambda folder, shown: [_images(folder, _white(shown))],
    "array of texts": lambda folder, shown: np.array(
        [str(file) for file in _images(folder, _white(shown))]
    ),
    ".npz": _npz,
    ".npy": _npy,
    ".tif of pages": lambda folder, shown: _pages(folder, _white(shown), ".tif"),
    ".gif of pages": lambda folder, shown: _pages(folder, _white(shown), ".gif"),
    "array": lambda folder, shown: shown,
    "tensor": lambda folder, shown: Tensor(shown),
    "list of masks": lambda folder, shown: list(shown),
    "list of a list of masks": lambda folder, shown: [list(shown)],
}


def _video(folder: Path, images: Any, suffix: str = ".avi") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"film{suffix}"
    # without losses, so that a film and its pictures are the same
    code = cv2.VideoWriter.fourcc(*"FFV1")
    writer = cv2.VideoWriter(str(path), code, FPS, SIZE)
    for image in images:
        writer.write(image)
    writer.release()
    return path


FILMS: dict[str, Written] = {
    "video": _video,
    ".mkv": lambda folder, images: _video(folder, images, ".mkv"),
    "folder of pictures": _folder,
    "list of pictures": _images,
    "list of lists of pictures": lambda folder, images: [_images(folder, images)],
    # OpenCV has blue first, and Pillow red
    ".tif of pictures": lambda folder, images: _pages(
        folder, images[..., ::-1], ".tif"
    ),
}


def _amc(folder: Path, motion: posefit.Motion) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    write_asf(folder / "walk.asf", motion.skeleton)
    write_amc(folder / "walk.amc", motion)
    return folder / "walk.amc"


def _bvh(folder: Path, motion: posefit.Motion) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    write_bvh(folder / "walk.bvh", motion)
    return folder / "walk.bvh"


MOTIONS: dict[str, Written] = {
    "Motion": lambda folder, motion: motion,
    ".amc": _amc,
    ".bvh": _bvh,
}
# motions that have a name, and no file of the user's
NAMED = {"built in": "walk", "library clip": "16_15"}

STREAMS: dict[str, Callable[[Any, Any], Sequence[Any]]] = {
    "masks": lambda shown, images: _white(shown),
    "pictures": lambda shown, images: list(images),
}


class Stream:
    """Frames of a stream, every `step`th of which is taken, as a slow tracker takes them."""

    def __init__(self, frames: Sequence[Any], step: int) -> None:
        self.name = "-"
        self.fps = FPS
        self.rate = FPS
        self._frames = frames
        self._step = step

    def __iter__(self) -> Iterator[LiveImage]:
        for number in range(0, len(self._frames), self._step):
            yield LiveImage(number, 100.0 + number / FPS, self._frames[number])
