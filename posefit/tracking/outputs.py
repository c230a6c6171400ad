"""The folder a track leaves behind: it appears whole under its name, or not at all.

Until it is whole it stands beside its place, hidden, with every frame that was estimated so far. Where a track ends too
early, because a disk is full or it is stopped, those frames are kept, and the same track can go on from them.
"""

import csv
import json
import os
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import repeat
from pathlib import Path
from typing import Any, Self

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.files import MARK, Unfinished, opencv_name, other_entries
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene
from posefit.footage.video import VideoWriter
from posefit.geometry.skeleton import ANGLES, JOINTS, Skeleton
from posefit.reading import cut
from posefit.silhouette.foreground import Image
from posefit.tracking.evaluation import unseen
from posefit.tracking.identity import Digest, difference
from posefit.tracking.measures import Rows
from posefit.tracking.page import track_document
from posefit.tracking.page.content import track_data
from posefit.tracking.page.stills import Stills
from posefit.tracking.picture import Painter
from posefit.tracking.table import undetermined
from posefit.tracking.trajectory import motion_of
from posefit.uncertainty.calibration import LEVELS
from posefit.uncertainty.intervals import angle_intervals, joint_intervals
from posefit.uncertainty.modes import Posterior

_MOTION_FILES = ("poses.npz", "track.amc", "skeleton.asf", "track.bvh", "track.glb", "track.trc", "track.c3d")
_OPENSIM = ("track.mot", "model.osim")
_TABLES = ("frames.csv", "angles.csv", "gait.csv", "summary.json", "camera.json")
FILES = (*_MOTION_FILES, *_OPENSIM, *_TABLES, "overlay.mp4", "summary.png", "track.html")
_RECORD = "frames.jsonl"
_MINE = (*FILES, _RECORD)  # what a track writes to its folder


class Output:
    """Where a track goes; here nowhere."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> None:
        """Nothing has to be closed."""

    def earlier(self) -> tuple[list[Frame], dict[str, Any] | None]:
        """Return the frames that were recorded before, and the state of the random generator after them."""
        return [], None

    def record(self, frame: Frame, state: dict[str, Any]) -> None:
        """Record a frame, and the state of the random generator after it."""

    def finish(self, scene: Scene, frames: Sequence[Frame], rows: Rows, summary: dict[str, Any]) -> None:
        """Write everything."""


class OutputFolder(Output):
    """Writes beside the target and renames at the end. Raises ValueError where the target may not be written.

    `spec` is what a track has to have in common with the one that it resumes.
    """

    def __init__(
        self,
        path: str | Path,
        force: bool,
        resume: bool,
        spec: Mapping[str, Digest],
        say: Callable[[str], None],
    ) -> None:
        self.path, self._spec, self._say, self._resume = Path(path), dict(spec), say, resume
        opencv_name(self.path)  # a name that it cannot write is refused before the work
        if os.path.lexists(self.path) and not self.path.is_dir():
            came = "a link that leads nowhere" if self.path.is_symlink() else "a file"
            raise InputError(f"{self.path}: expected a folder to write to, got {came}")
        if self.path.exists() and not force:
            raise InputError(f"{self.path}: expected a new folder, got one that exists; --force replaces it")
        if self.path.exists() and (others := other_entries(self.path, _MINE)):
            came = f"one with {cut(others[0])}"
            raise InputError(f"{self.path}: expected a folder of earlier results to replace, got {came}")
        self._recorded, self._force = 0, force
        self._place = self._same() if resume else None

    def _same(self) -> Unfinished:
        """Return the folder of the track that goes on: the latest with the same arguments."""
        left = Unfinished.interrupted(self.path)
        if not left:
            raise InputError(f"{self.path}: expected a track that was interrupted to resume, got none")
        try:
            others = [difference(folder.info, self._spec) for folder in left]
        except (AttributeError, TypeError):
            raise InputError(f"{left[0].path / MARK}: expected the arguments of a track, got others") from None
        place = left[others.index(None)] if None in others else None
        for folder in left:
            if folder is not place:
                folder.close()
        if place is None:
            raise InputError(f"{self.path}: {others[0]}")
        return place

    def __enter__(self) -> Self:
        try:
            if self._place is None:
                for earlier in Unfinished.interrupted(self.path):
                    earlier.remove(_MINE)
                self._place = Unfinished.begin(self.path, self._spec)
            self._building = self._place.path
        except OSError as error:
            raise InputError(f"{self.path}: expected a place to write to, got {error.strerror}") from None
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> None:
        assert self._place is not None
        if kind is None:
            try:
                self._place.finish(_MINE, self._force)
            except OSError as taken:
                self._place.close()
                where = f"{taken.strerror}; the results are in {self._building}"
                raise InputError(f"{self.path}: expected its name to be free, got {where}") from None
            (self.path / _RECORD).unlink(missing_ok=True)
            return
        kept = ""
        if self._recorded:
            for name in FILES:
                (self._building / name).unlink(missing_ok=True)
            kept = f"; {self._recorded} finished frames are kept: the same command with --resume goes on from there"
            self._place.close()
        else:
            self._place.remove(_MINE)
        if isinstance(error, OSError):
            raise InputError(f"{self.path}: expected room to write to, got {error.strerror or error}{kept}") from error
        if kept and isinstance(error, InputError):
            raise InputError(f"{error}{kept}") from error
        if kept:
            self._say(kept[2:])

    def earlier(self) -> tuple[list[Frame], dict[str, Any] | None]:
        """Return the frames that were recorded before, and the state of the random generator after them."""
        frames: list[Frame] = []
        kept: list[bytes] = []
        state: dict[str, Any] | None = None
        path = self._building / _RECORD
        recorded = path.read_bytes() if path.is_file() and not path.is_symlink() else b""
        for number, line in enumerate(recorded.splitlines(keepends=True), 1):
            try:
                frame, state = _frame_of(line)
            except Exception as error:  # whatever a damaged line raises
                if line.endswith(b"\n"):  # else it was being written when the track ended
                    reason = cut(" ".join(str(error).split()))
                    self._say(
                        f"warning: {path} line {number}: expected a frame, got {reason}; tracked again from there"
                    )
                break
            frames.append(frame)
            kept.append(line)
        if frames:
            path.write_bytes(b"".join(kept))
        self._recorded = len(frames)
        return frames, state

    def record(self, frame: Frame, state: dict[str, Any]) -> None:
        """Record a frame, and the state of the random generator after it."""
        posterior = None if frame.posterior is None else frame.posterior.as_dict()
        row = {**vars(frame), "posterior": posterior, "modes": (), "state": state}
        text = json.dumps(row, default=_encoded).encode()
        with (self._building / _RECORD).open("ab") as file:
            file.write(b"%08x %s\n" % (zlib.crc32(text), text))
        self._recorded += 1

    def finish(self, scene: Scene, frames: Sequence[Frame], rows: Rows, summary: dict[str, Any]) -> None:
        """Write everything."""
        import cv2

        folder, stills = self._building, Stills(scene)
        painter = Painter(scene, [row["usable"] == 1.0 for row in rows])
        intervals = intervals_of(scene.body.skeleton, frames)
        radii = intervals.get("joint_radii", repeat(None))
        _write_formats(folder, scene, frames, rows, summary, intervals)
        writer: VideoWriter | None = None
        for frame, observation, picture, row, frame_radii in zip(frames, *_filmed(scene), rows, radii, strict=False):
            stills.add(frame, observation, picture)
            image = painter.add(frame, observation, row, picture, frame_radii)
            if writer is None:
                writer = VideoWriter(folder / "overlay.mp4", scene.fps, (image.shape[1], image.shape[0]))
            writer.write(image)
        assert writer is not None
        writer.close()
        notes = ("" if summary["trust"] is None else summary["trust"]["sentence"], undetermined(summary))
        if not cv2.imwrite(opencv_name(folder / "summary.png"), painter.summary(rows, [*filter(None, notes)])):
            raise OSError("no room for summary.png")
        page = track_document(track_data(scene, frames, rows, summary, intervals, stills))
        (folder / "track.html").write_text(page, encoding="utf-8", newline="\n")


def page_of(scene: Scene, frames: Sequence[Frame], rows: Rows, summary: dict[str, Any]) -> str:
    """Return the page of a track, `track.html`."""
    stills = Stills(scene)
    for frame, observation, picture in zip(frames, *_filmed(scene), strict=False):
        stills.add(frame, observation, picture)
    return track_document(track_data(scene, frames, rows, summary, intervals_of(scene.body.skeleton, frames), stills))


def _encoded(value: Any) -> Any:
    """Return what JSON holds of a frame's values: arrays with their type, else what it prints as."""
    if isinstance(value, np.ndarray | np.generic):
        return {"dtype": str(value.dtype), "values": value.tolist()}
    return dict(value) if isinstance(value, Mapping) else str(value)


def _decoded(mapping: dict[str, Any]) -> Any:
    if mapping.keys() == {"dtype", "values"}:
        return np.array(mapping["values"], dtype=mapping["dtype"])
    return mapping


def _frame_of(line: bytes) -> tuple[Frame, dict[str, Any]]:
    """Return a recorded frame, and the state of the random generator after it. Raises an error where it is damaged."""
    checksum, _, text = line.rstrip(b"\n").partition(b" ")
    if not line.endswith(b"\n") or checksum != b"%08x" % zlib.crc32(text):
        raise InputError("a damaged one")
    row = json.loads(text, object_hook=_decoded)
    state, posterior = row.pop("state"), row.pop("posterior")
    np.random.default_rng(0).bit_generator.state = state  # raises where it is none
    return Frame(**row, posterior=None if posterior is None else Posterior.from_dict(posterior)), state


def intervals_of(skeleton: Skeleton, frames: Sequence[Frame]) -> dict[str, Array]:
    """Return how far joints and angles may be off, as poses.npz has it; empty where no frame has a posterior.

    `levels` (3,), `joint_radii` (T, 3, 27) metres, `angle_halves` (T, 3, 66) radians; NaN in frames without any.
    """
    if all(frame.posterior is None for frame in frames):
        return {}
    radii = np.full((len(frames), len(LEVELS), len(JOINTS)), np.nan)
    halves = np.full((len(frames), len(LEVELS), ANGLES), np.nan)
    for k, frame in enumerate(frames):
        if frame.posterior is not None:
            radii[k] = joint_intervals(skeleton, frame.posterior, frame.pose)
            halves[k] = angle_intervals(frame.posterior, frame.pose)
    return {"levels": np.array(LEVELS), "joint_radii": radii, "angle_halves": halves}


def _filmed(scene: Scene) -> tuple[Iterable[Observation], Iterable[Image | None]]:
    """Return what was observed in each frame, and the footage of each, None where there is none."""
    return scene.observations, repeat(None) if scene.pictures is None else scene.pictures()


def _write_formats(
    folder: Path,
    scene: Scene,
    frames: Sequence[Frame],
    rows: Rows,
    summary: dict[str, Any],
    intervals: Mapping[str, Array],
) -> None:
    """Write every file of a track to a folder but for its pictures and its page; see `FILES`."""
    from posefit.measuring.c3d import write_c3d
    from posefit.measuring.centres import PLACES
    from posefit.measuring.gait import gait_of
    from posefit.measuring.tables import write_angles, write_gait, write_trc
    from posefit.motion.amc import write_amc
    from posefit.motion.asf import write_asf
    from posefit.motion.bvh import write_bvh
    from posefit.motion.gltf import write_glb
    from posefit.motion.opensim import write_mot, write_osim

    estimate = motion_of(scene, frames)
    np.savez_compressed(
        folder / "poses.npz",
        poses=estimate.poses,
        translations=estimate.translations,
        fps=np.array(estimate.fps),
        frames=estimate.first + np.arange(len(estimate)),
        joints=np.array(JOINTS),
        places=np.array(PLACES),
        costs=np.array([frame.cost for frame in frames]),
        radii=scene.body.radii,
        **dict[str, Any](intervals),
    )
    write_asf(folder / "skeleton.asf", estimate.skeleton)
    write_amc(folder / "track.amc", estimate)
    write_bvh(folder / "track.bvh", estimate)
    write_glb(folder / "track.glb", estimate, scene.body.radii)
    write_osim(folder / "model.osim", scene.body, PLACES)
    write_mot(folder / "track.mot", estimate)
    blank = unseen(rows)
    gait = gait_of(estimate, blank)
    write_trc(folder / "track.trc", estimate, blank)
    write_c3d(folder / "track.c3d", estimate, blank, gait)
    write_angles(folder / "angles.csv", estimate, blank)
    write_gait(folder / "gait.csv", gait)
    (folder / "camera.json").write_text(scene.cameras[0].to_json(), encoding="utf-8")
    names = [f"{place}_{axis}" for place in PLACES for axis in "xyz"]
    with (folder / "frames.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*rows[0], "activity", *names])
        for k, (row, frame, points) in enumerate(zip(rows, frames, estimate.joints, strict=True)):
            values = ["" if np.isnan(value) else value for value in row.values()]
            writer.writerow(
                [*values, frame.activity, *("" if k in blank else f"{value:.6f}" for value in points.reshape(-1))]
            )
    (folder / "summary.json").write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")
