"""The folder a track leaves behind: it appears whole under its name, or not at all.

Until it is whole it stands beside its place, hidden, with every frame that was estimated so far. Where a track ends too
early, because a disk is full or it is stopped, those frames are kept, and the same track can go on from them.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from itertools import repeat
from pathlib import Path
from typing import Any, Protocol, Self

import numpy as np

from posefit.errors import InputError
from posefit.files import Unfinished, other_entries
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.footage.video import VideoWriter
from posefit.motion.motion import Motion
from posefit.reading import cut
from posefit.tracking.formats import FILES, Rows, State, intervals_of, write_formats
from posefit.tracking.identity import ArgumentDigest, difference
from posefit.tracking.page import track_document
from posefit.tracking.page.content import track_data
from posefit.tracking.page.stills import Stills
from posefit.tracking.picture import Painter
from posefit.tracking.table import undetermined
from posefit.uncertainty.modes import Posterior

_RECORD = "frames.jsonl"
_MINE = (*FILES, _RECORD)  # what a track writes to its folder
_ARRAYS = ("pose", "translation", "areas", "history", "coordinates", "spent")
_PLAIN = ("cost", "evaluations", "seconds", "cpu_seconds", "lost", "details")


class Output(Protocol):
    """Where a track goes."""

    def earlier(self) -> tuple[list[Frame], State | None]:
        """Return the frames that were recorded before, and the state of the random generator after them."""
        ...

    def record(self, frame: Frame, state: State) -> None:
        """Record a frame, and the state of the random generator after it."""
        ...

    def finish(self, scene: Scene, estimate: Motion, frames: Sequence[Frame], rows: Rows, summary: State) -> None:
        """Write everything."""
        ...


class Nowhere:
    """The output of a track that is not written."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Nothing has to be closed."""

    def earlier(self) -> tuple[list[Frame], State | None]:
        """Return that there is nothing."""
        return [], None

    def record(self, frame: Frame, state: State) -> None:
        """Keep nothing."""

    def finish(self, scene: Scene, estimate: Motion, frames: Sequence[Frame], rows: Rows, summary: State) -> None:
        """Write nothing."""


class OutputFolder:
    """Writes beside the target and renames at the end. Raises ValueError where the target may not be written.

    `spec` is what a track has to have in common with the one that it resumes.
    """

    def __init__(
        self,
        path: str | Path,
        force: bool,
        resume: bool,
        spec: Mapping[str, ArgumentDigest],
        say: Callable[[str], None],
    ) -> None:
        self.path, self._spec, self._say, self._resume = Path(path), dict(spec), say, resume
        if self.path.exists() and not self.path.is_dir():
            raise InputError(f"{self.path}: expected a folder to write to, got a file")
        if self.path.exists() and not force:
            raise InputError(f"{self.path}: expected a new folder, got one that exists; --force replaces it")
        if self.path.exists() and (others := other_entries(self.path, _MINE)):
            came = f"one with {cut(others[0])}"
            raise InputError(f"{self.path}: expected a folder of earlier results to replace, got {came}")
        self._recorded = 0
        self._place = self._same() if resume else None

    def _same(self) -> Unfinished:
        """Return the folder of the track that goes on: the latest with the same arguments."""
        left = Unfinished.interrupted(self.path)
        if not left:
            raise InputError(f"{self.path}: expected a track that was interrupted to resume, got none")
        others = [difference(one.info, self._spec) for one in left]
        place = left[others.index(None)] if None in others else None
        for one in left:
            if one is not place:
                one.close()
        if place is None:
            raise InputError(f"{self.path}: {others[0]}")
        return place

    def __enter__(self) -> Self:
        arguments = {name: one.as_json() for name, one in self._spec.items()}
        try:
            if self._place is None:
                for earlier in Unfinished.interrupted(self.path):
                    earlier.remove(_MINE)
                self._place = Unfinished.begin(self.path, arguments)
            self._building = self._place.path
        except OSError as error:
            raise InputError(f"{self.path}: expected a place to write to, got {error.strerror}") from None
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> None:
        assert self._place is not None
        if kind is None:
            try:
                self._place.finish(_MINE)
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

    def earlier(self) -> tuple[list[Frame], State | None]:
        """Return the frames that were recorded before, and the state of the random generator after them."""
        frames: list[Frame] = []
        whole: list[str] = []
        state: State | None = None
        path = self._building / _RECORD
        for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
            try:
                row = json.loads(line, object_hook=_decoded)
                values = {name: row[name] for name in _PLAIN}
                values |= {name: None if row[name] is None else np.array(row[name]) for name in _ARRAYS}
                posterior = row["posterior"]
                values["posterior"] = None if posterior is None else Posterior.from_dict(posterior)
            except (ValueError, KeyError):
                break  # the line that was being written when it ended
            frames.append(Frame(**values))
            state = row["state"]
            whole.append(line)
        if frames:
            path.write_text("".join(f"{line}\n" for line in whole), encoding="utf-8")
        self._recorded = len(frames)
        return frames, state

    def record(self, frame: Frame, state: State) -> None:
        """Record a frame, and the state of the random generator after it."""
        row: State = {name: getattr(frame, name) for name in _PLAIN} | {"state": state}
        for name in _ARRAYS:
            value = getattr(frame, name)
            row[name] = None if value is None else np.asarray(value).tolist()
        row["posterior"] = None if frame.posterior is None else frame.posterior.as_dict()
        with (self._building / _RECORD).open("a", encoding="utf-8") as file:
            file.write(json.dumps(row, default=_encoded) + "\n")
        self._recorded += 1

    def finish(self, scene: Scene, estimate: Motion, frames: Sequence[Frame], rows: Rows, summary: State) -> None:
        """Write everything."""
        import cv2

        folder, stills = self._building, Stills(scene)
        painter = Painter(scene, [row["usable"] == 1.0 for row in rows])
        sure = intervals_of(scene.body.skeleton, frames)
        radii = sure.get("joint_radii")
        write_formats(folder, scene, estimate, frames, rows, summary, sure)
        filmed = scene.pictures() if scene.pictures is not None else repeat(None)
        writer: VideoWriter | None = None
        each_radii = repeat(None) if radii is None else radii
        for frame, observation, row, picture, one in zip(
            frames, scene.observations, rows, filmed, each_radii, strict=False
        ):
            stills.add(frame, observation, picture)
            image = painter.add(frame, observation, row, picture, one)
            if writer is None:
                writer = VideoWriter(folder / "overlay.mp4", scene.fps, (image.shape[1], image.shape[0]))
            writer.write(image)
        assert writer is not None
        writer.close()
        trust = "" if summary["trust"] is None else summary["trust"]["sentence"]
        if not cv2.imwrite(str(folder / "summary.png"), painter.summary(rows, radii, undetermined(summary), trust)):
            raise OSError("no room for summary.png")
        page = track_document(track_data(scene, estimate, frames, rows, summary, sure, stills))
        (folder / "track.html").write_text(page, encoding="utf-8", newline="\n")


def _encoded(value: Any) -> Any:
    """Return what JSON holds of a value in a frame's details: arrays with their type, else what it prints as."""
    if isinstance(value, np.ndarray | np.generic):
        return {"dtype": str(value.dtype), "values": value.tolist()}
    return dict(value) if isinstance(value, Mapping) else str(value)


def _decoded(mapping: dict[str, Any]) -> Any:
    """Return a mapping of JSON, or the array that it holds."""
    if mapping.keys() == {"dtype", "values"}:
        return np.array(mapping["values"], dtype=mapping["dtype"])
    return mapping
