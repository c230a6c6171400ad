"""The folder a track leaves behind: it appears whole under its name, or not at all.

Until it is whole it stands beside its place, hidden, with every frame that was estimated so far. Where a track ends too
early, because a disk is full or it is stopped, those frames are kept, and the same track can go on from them.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

from posefit.errors import InputError
from posefit.files import MARK, Unfinished, opencv_name, other_entries
from posefit.fitting.carried import CARRIED, with_carried
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.output.content import Content
from posefit.output.files import FILES, WRITERS, video_warning, write_files
from posefit.output.identity import Digest, difference
from posefit.output.record import (
    append_frame,
    read_carried,
    read_frames,
    write_carried,
)
from posefit.progress import WARNING
from posefit.reading import cut, parsed_json, read_text

RECORD = "frames.jsonl"
SUMMARY = "summary.json"
MAX_SUMMARY_BYTES = 10_000_000
# what a filter carries from the latest frame, and from the one before it
CARRIED_FILES = ("carried-0.npz", "carried-1.npz")
# the names of what a track writes to its folder
_WRITTEN = (*FILES, RECORD, *CARRIED_FILES)


class Recorder:
    """Where the frames of a track are recorded as they come; here nowhere."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: object
    ) -> None:
        """Nothing has to be closed."""

    def earlier(self) -> tuple[list[Frame], dict[str, Any] | None]:
        """Return the frames that were recorded before, and the state of the random generator after them."""
        return [], None

    def record(self, frame: Frame, state: dict[str, Any]) -> None:
        """Record a frame, and the state of the random generator after it."""

    def begin(self, scene: Scene) -> None:
        """Say before the work what of a scene's track cannot be written."""

    def finish(self, content: Content) -> None:
        """Write everything."""


class OutputFolder(Recorder):
    """Writes beside the target and renames at the end. Raises InputError where the target may not be written.

    `spec` is what a track has to have in common with the one that it resumes, and `kinds` are those of `chosen_kinds`.
    """

    def __init__(
        self,
        path: str | Path,
        force: bool,
        resume: bool,
        spec: Mapping[str, Digest],
        log: Callable[[str], None],
        kinds: Sequence[str] = tuple(WRITERS),
    ) -> None:
        self.path, self._spec, self._log = Path(path), dict(spec), log
        self._kinds = kinds
        self._recorded = 0
        self._slot = 0  # of the carried files, the one that is written next
        self._force = force
        _check_target(self.path, force)
        self._unfinished = _interrupted(self.path, self._spec) if resume else None

    def __enter__(self) -> Self:
        try:
            if self._unfinished is None:
                for earlier in Unfinished.interrupted(self.path):
                    earlier.remove(_WRITTEN)
                self._unfinished = Unfinished.begin(self.path, self._spec)
            self.building = self._unfinished.path
            # now, so that they are kept whatever fails before the first new frame
            frames, state, damage = read_frames(self.building / RECORD)
        except OSError as error:
            raise InputError(
                f"{self.path}: expected a place to write to, got {error.strerror}"
            ) from None
        if damage:
            self._log(f"{WARNING}{damage}; tracked again from there")
        latest = -1
        for slot, name in enumerate(CARRIED_FILES):
            kept = read_carried(self.building / name)
            # one of a frame that was not recorded any more counts for nothing
            if kept is not None and latest < kept[0] < len(frames):
                latest = kept[0]
                self._slot = 1 - slot
                frames[latest] = with_carried(frames[latest], kept[1])
        self._earlier = (frames, state)
        self._recorded = len(frames)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: object
    ) -> None:
        assert self._unfinished is not None
        if kind is None:
            try:
                self._unfinished.finish(_WRITTEN, self._force)
            except OSError as failure:
                self._unfinished.close()
                where = f"{failure.strerror}; the results are in {self.building}"
                raise InputError(
                    f"{self.path}: expected its name to be free, got {where}"
                ) from None
            for name in (RECORD, *CARRIED_FILES):
                (self.path / name).unlink(missing_ok=True)
            return
        notice = ""
        if self._recorded:
            for name in FILES:
                (self.building / name).unlink(missing_ok=True)
            notice = f"; {self._recorded} finished frames are kept: the same command with --resume goes on from there"
            self._unfinished.close()
        else:
            self._unfinished.remove(_WRITTEN)
        if isinstance(error, OSError):
            came = f"{error.strerror or error}{notice}"
            raise InputError(
                f"{self.path}: expected room to write to, got {came}"
            ) from error
        if notice and isinstance(error, InputError):
            raise InputError(f"{error}{notice}") from error
        if notice:
            self._log(notice[2:])

    def earlier(self) -> tuple[list[Frame], dict[str, Any] | None]:
        """Return the frames that were recorded before, and the state of the random generator after them."""
        frames, state = self._earlier
        return list(frames), state

    def record(self, frame: Frame, state: dict[str, Any]) -> None:
        """Record a frame, and the state of the random generator after it."""
        if (kept := frame.details.get(CARRIED)) is not None:
            # the one before it stays until the frame is recorded
            write_carried(
                self.building / CARRIED_FILES[self._slot], self._recorded, kept
            )
            self._slot = 1 - self._slot
        append_frame(self.building / RECORD, with_carried(frame, None), state)
        self._recorded += 1

    def begin(self, scene: Scene) -> None:
        """Say before the work what of a scene's track cannot be written."""
        if "mp4" not in self._kinds:
            return
        if warning := video_warning(self.building, scene):
            self._log(f"{WARNING}{warning}")

    def finish(self, content: Content) -> None:
        """Write everything, but for pictures that cannot be made: the poses do not depend on them."""
        for warning in write_files(self.building, content, self._kinds):
            self._log(f"{WARNING}{warning}")


def _check_target(path: Path, force: bool) -> None:
    """Raise InputError where a folder may not be written under a name, before the work."""
    opencv_name(path)  # it writes no other name
    if not os.path.lexists(path):
        return
    if path.is_symlink() or not path.is_dir():
        came = "a link" if path.is_symlink() else "a file"
        raise InputError(f"{path}: expected a folder to write to, got {came}")
    if not force:
        raise InputError(
            f"{path}: expected a new folder, got one that exists; --force replaces it"
        )
    if others := other_entries(path, _WRITTEN) or _unmarked(path):
        came = f"one with {cut(others[0])}, which is none of posefit's"
        raise InputError(
            f"{path}: expected a folder of earlier results to replace, got {came}"
        )


def _interrupted(path: Path, spec: Mapping[str, Digest]) -> Unfinished:
    """Return the unfinished folder of the track that goes on: the latest with the same arguments."""
    interrupted = Unfinished.interrupted(path)
    if not interrupted:
        raise InputError(
            f"{path}: expected a track that was interrupted to resume, got none"
        )
    try:
        others = [difference(folder.info, spec) for folder in interrupted]
    except (AttributeError, TypeError):
        raise InputError(
            f"{interrupted[0].path / MARK}: expected the arguments of a track, got others"
        ) from None
    place = interrupted[others.index(None)] if None in others else None
    for folder in interrupted:
        if folder is not place:
            folder.close()
    if place is None:
        raise InputError(f"{path}: {others[0]}")
    return place


def _unmarked(folder: Path) -> list[str]:
    """Return the files of a folder whose summary is not one of a track: somebody else's."""
    names = sorted(entry.name for entry in folder.iterdir())
    try:
        summary = parsed_json(read_text(folder / SUMMARY, MAX_SUMMARY_BYTES))
    except (OSError, ValueError):
        return names
    marked = (
        isinstance(summary, dict)
        and {"version", "method", "evaluations", "trust"} <= summary.keys()
    )
    return [] if marked else names
