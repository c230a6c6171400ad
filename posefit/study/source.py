"""Turns the name of a source into motions, masks and cameras: a built-in motion, a capture file or masks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.fitting.tracker import Observation
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import Array
from posefit.motion.motion import Motion
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette

IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm")
VIEW_DEGREES = 45.0  # where the camera of a synthetic sequence stands when nobody says: 0 is in front, 90 to the side
BITE = 2_000_000_000  # bytes; the largest .npz of masks that is read
Range = tuple[int | None, int | None]


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything a tracker needs to know of a source."""

    name: str
    body: Body
    cameras: Sequence[Camera]
    fps: float
    count: int
    yaw: float | None  # radians: about where the person faces at first
    anchor: Array  # (3,) metres: about where the root is at first
    truth: Motion | None
    observations: "Sequence[Observation] | LazyMasks" = field(repr=False)


def motion_of(source: str | Path | Motion, asf: str | Path | None, fps: float) -> Motion:
    """Return the motion a source names, at `fps`: a built-in motion's name, an .amc file or a .bvh file.

    The .asf of an .amc is `asf`, or the only one beside it.
    """
    if isinstance(source, Motion):
        return source.resampled(fps)
    from posefit.motion import library

    if source in library.names():
        return library.built_in(str(source), fps=fps)
    path = Path(source)
    if path.suffix.lower() == ".amc":
        from posefit.motion.amc import read_clip

        return read_clip(_skeleton_file(path, asf), _existing(path)).resampled(fps)
    if path.suffix.lower() == ".bvh":
        from posefit.motion.bvh import read_bvh

        return read_bvh(_existing(path)).resampled(fps)
    if path.exists() or path.suffix:
        _existing(path)
        raise ValueError(
            f"{path}: expected an .amc file, a .bvh file or a built-in motion, got {path.suffix or 'a folder'}"
        )
    return library.built_in(str(source), fps=fps)


def is_masks(source: str | Path | Motion) -> bool:
    """Return whether a source names masks: a folder, or an .npz file. A built-in motion's name is never a folder."""
    from posefit.motion import library

    if isinstance(source, Motion) or source in library.names():
        return False
    return Path(source).is_dir() or Path(source).suffix.lower() == ".npz"


def synthetic(
    motion: Motion, view_degrees: float | None, size: tuple[int, int], camera: Camera | None, frames: Range
) -> Scene:
    """Return the sequence that a camera sees of a motion; masks are drawn frame by frame as they are needed."""
    body = Body.of(motion.skeleton)
    motion = motion.frames(*_span(frames, len(motion)))
    if camera is None:
        joints = motion.skeleton.joints(motion.poses, motion.translations).reshape(-1, 3)
        azimuth = motion.poses[0, 0] + np.radians(VIEW_DEGREES if view_degrees is None else view_degrees)
        camera = Camera.framing(joints, np.tile(body.joint_radii(), len(motion)), azimuth, size)
    observations = Rendered(motion, body, camera)
    for k in (0, len(motion) - 1):
        if not observations[k].silhouettes[0].mask.any():
            raise ValueError(f"camera must see the person, got an empty mask in frame {k}")
    return Scene(
        motion.name,
        body,
        [camera],
        motion.fps,
        len(motion),
        float(motion.poses[0, 0]),
        motion.translations[0],
        motion,
        observations,
    )


@dataclass(frozen=True, eq=False)
class Rendered(Sequence[Observation]):
    """The observations of a known motion, drawn when asked for."""

    motion: Motion
    body: Body
    camera: Camera

    def __len__(self) -> int:
        return len(self.motion)

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        if k >= len(self):
            raise IndexError(k)
        pose, translation = self.motion.poses[k], self.motion.translations[k]
        return Observation([Silhouette.of(project(self.body, self.camera, pose, translation))], translation)


def observed(
    source: str | Path, body: Body, view_degrees: float | None, camera: Camera | None, fps: float, frames: Range
) -> Scene:
    """Return the sequence of a folder of mask images or an .npz of masks (T, height, width) under the key `masks`.

    Without a camera one is guessed: level, 40 degrees across, the person as far away as its size asks.
    """
    masks = LazyMasks.of(Path(source), frames)
    first = masks.silhouette(masks.first)
    joints = body.skeleton.joints(np.zeros(66))
    tall = float(np.ptp(joints[:, 1]) + 2.0 * body.radii.max() * 0.5)
    if camera is None:
        camera = Camera.around(np.zeros(3), 0.0, 0.0, first.size)
    rows, columns = np.flatnonzero(first.mask.any(axis=1)), np.flatnonzero(first.mask.any(axis=0))
    depth = camera.focal[1] * tall / (rows[-1] + 1 - rows[0])
    middle = 0.5 * np.array([columns[0] + columns[-1] + 1, rows[0] + rows[-1] + 1])
    seen = np.array([*((middle - camera.centre) / camera.focal * depth), depth])
    anchor = camera.rotation.T @ (seen - camera.translation)
    to_camera = -camera.rotation[2]
    yaw = None
    if view_degrees is not None:
        yaw = float(np.arctan2(to_camera[0], to_camera[2]) - np.radians(view_degrees))
    return Scene(Path(source).stem, body, [camera], fps, len(masks), yaw, anchor, None, masks)


@dataclass(frozen=True, eq=False)
class LazyMasks:
    """Masks that are read when their turn comes, so that memory does not grow with their number."""

    path: Path
    files: Sequence[Path]
    stack: NDArray[Any] | None = field(default=None, repr=False)
    known: NDArray[Any] | None = field(default=None, repr=False)  # of the same shape; 0 where nothing is known
    usable: NDArray[np.bool_] | None = field(default=None, repr=False)  # (T,)

    @classmethod
    def of(cls, path: Path, frames: Range) -> "LazyMasks":
        """Return the masks of a folder or an .npz file, cut to `frames`."""
        if path.is_dir():
            files = sorted(file for file in path.iterdir() if file.suffix.lower() in IMAGES)
            if not files:
                raise ValueError(f"{path}: expected a folder with mask images ({', '.join(IMAGES)}), got none")
            return cls(path, files[slice(*_span(frames, len(files)))])
        _existing(path)
        if path.stat().st_size > BITE:
            raise ValueError(f"{path}: expected at most {BITE // 10**9} GB, got {path.stat().st_size / 1e9:.1f} GB")
        try:
            with np.load(path, allow_pickle=False) as stored:
                stack = stored["masks"]
                known, usable = stored.get("valid"), stored.get("usable")
        except (KeyError, ValueError, OSError, EOFError) as error:
            raise ValueError(f"{path}: expected an .npz file with the key masks, got {error}") from None
        if stack.ndim != 3 or not len(stack) or stack.dtype.kind not in "buif":
            raise ValueError(f"{path}: masks must have shape (frames, height, width), got {stack.shape} {stack.dtype}")
        if stack.dtype.kind == "f" and not np.isfinite(stack).all():
            raise ValueError(f"{path}: masks must be finite, got nan or infinity")
        if known is not None and (known.shape != stack.shape or known.dtype.kind not in "bui"):
            raise ValueError(f"{path}: valid must have the masks' shape {stack.shape}, got {known.shape} {known.dtype}")
        start, stop = _span(frames, len(stack))
        if usable is not None and (usable.shape != stack.shape[:1] or usable.dtype != np.bool_):
            raise ValueError(f"{path}: usable must be {len(stack)} booleans, got {usable.shape} {usable.dtype}")
        names, part = [Path(f"{path}[{k}]") for k in range(start, stop)], slice(start, stop)
        known, usable = (None if value is None else value[part] for value in (known, usable))
        if usable is not None and not usable.any():
            raise ValueError(f"{path}: expected a frame that is usable, got none from {start} to {stop}")
        return cls(path, names, stack[part], known, usable)

    def __len__(self) -> int:
        return len(self.files)

    def __iter__(self) -> Iterator[Observation]:
        size = self.silhouette(self.first).size
        for k in range(len(self)):
            silhouette = self.silhouette(k)
            if silhouette.size != size:
                expected, came = ((s[1], s[0]) for s in (size, silhouette.size))
                raise ValueError(f"{self.files[k]}: mask must have shape {expected}, got {came}")
            yield Observation([silhouette], usable=self.is_usable(k))

    def is_usable(self, k: int) -> bool:
        """Return whether mask k shows enough of the person to be searched; masks that do not say so do."""
        return self.usable is None or bool(self.usable[k])

    @property
    def first(self) -> int:
        """Which mask is the first one that is usable."""
        return 0 if self.usable is None else int(self.usable.argmax())

    def silhouette(self, k: int) -> Silhouette:
        """Return mask k. Raises ValueError naming the file where it is no mask, or empty, or full."""
        mask = self.stack[k] if self.stack is not None else self._image(self.files[k])
        person = np.greater(mask, 127 if mask.max() > 1 else 0)
        if self.is_usable(k) and (not person.any() or person.all()):
            came = "an empty one" if not person.any() else "one without background"
            raise ValueError(f"{self.files[k]}: expected a mask with a person before a background, got {came}")
        return Silhouette.of(person, None if self.known is None else self.known[k])

    @staticmethod
    def _image(path: Path) -> NDArray[Any]:
        import cv2

        image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        if image is None:
            raise ValueError(f"{path}: expected an image, got a file that is none")
        return image


def _span(frames: Range, count: int) -> tuple[int, int]:
    start, stop, _ = slice(*frames).indices(count)
    if start >= stop:
        low, high = ("" if value is None else value for value in frames)
        raise ValueError(f"frames must choose some of the {count} frames, got {low}:{high}")
    return start, stop


def _existing(path: Path) -> Path:
    if not path.exists():
        raise ValueError(f"{path}: expected a file, got nothing of that name")
    if path.is_file() and not path.stat().st_size:
        raise ValueError(f"{path}: expected a file with content, got an empty one")
    return path


def _skeleton_file(amc: Path, asf: str | Path | None) -> Path:
    if asf is not None:
        return _existing(Path(asf))
    _existing(amc)
    beside = sorted(amc.parent.glob("*.asf"))
    if len(beside) != 1:
        raise ValueError(f"{amc}: expected --asf or exactly one .asf file beside it, got {len(beside)}")
    return beside[0]
