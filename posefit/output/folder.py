"""The output folder of a track, which appears under its name only when it is complete.

Until then a hidden folder next to it contains the frames that were estimated so far. If
a track is interrupted, because the disk is full or a user stops it, these frames are
kept, and the same track can be resumed from them.
"""

import errno
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
from posefit.output.files import FILES, WRITERS, write_files
from posefit.output.identity import Digest, difference
from posefit.output.pictures import video_warning
from posefit.output.record import (
    append_frame,
    read_carried,
    read_frames,
    write_carried,
)
from posefit.progress import WARNING
from posefit.reading import cut, parsed_json, read_text

# a full disk, a quota, and a limit on the size of files
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
RECORD = "frames.jsonl"
SUMMARY = "summary.json"
MAX_SUMMARY_BYTES = 10_000_000
# the state that a filter carries from the latest frame, and from the one before
CARRIED_FILES = ("carried-0.npz", "carried-1.npz")
# the names of all files that a track writes to its folder
_WRITTEN = (*FILES, RECORD, *CARRIED_FILES)


class Recorder:
    """Records each frame of a track at once. This base class records nothing."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: object
    ) -> None:
        """Close nothing: this class keeps nothing open."""

    def earlier(self) -> tuple[list[Frame], dict[str, Any] | None]:
        """Return the frames recorded before, and the random state after the last."""
        return [], None

    def record(self, frame: Frame, state: dict[str, Any]) -> None:
        """Record a frame, and the random state after it."""

    def begin(self, scene: Scene) -> None:
        """Warn before the work if some file of a scene's track cannot be written."""

    def finish(self, content: Content) -> None:
        """Write everything."""


class OutputFolder(Recorder):
    """Writes to a hidden folder next to the target, and renames it at the end.

    `identity` has the arguments that a track must share with the track that it resumes.
    `kinds` are the kinds of files, as `chosen_kinds` returns them. Raises InputError if
    the target may not be written.
    """

    def __init__(
        self,
        path: str | Path,
        force: bool,
        resume: bool,
        identity: Mapping[str, Digest],
        log: Callable[[str], None],
        kinds: Sequence[str] = tuple(WRITERS),
    ) -> None:
        self.path = Path(path)
        self._identity = dict(identity)
        self._log = log
        self._kinds = kinds
        self._recorded = 0
        self._slot = 0  # the index of the carried file that is written next
        self._force = force
        _check_target(self.path, force)
        self._unfinished = _interrupted(self.path, self._identity) if resume else None

    def __enter__(self) -> Self:
        try:
            if self._unfinished is None:
                for earlier in Unfinished.interrupted(self.path):
                    earlier.remove(_WRITTEN)
                self._unfinished = Unfinished.begin(self.path, self._identity)
            self.building = self._unfinished.path
            # read now, to keep them if something fails before the first new frame
            frames, state, damage = read_frames(self.building / RECORD)
        except OSError as error:
            raise InputError(
                f"{self.path}: cannot write there: {error.strerror}"
            ) from None
        if damage:
            self._log(f"{WARNING}{damage}; tracked again from there")
        latest = -1
        for slot, name in enumerate(CARRIED_FILES):
            kept = read_carried(self.building / name)
            # ignore a file that belongs to a frame which was never recorded
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
            self._publish(self._unfinished)
            return
        notice = self._keep_record(self._unfinished)
        # the notice goes into the error's own message, if the user will see that
        if isinstance(error, OSError) and self._is_about_folder(error):
            cause = f"{error.strerror or error}{notice}"
            raise InputError(f"{self.path}: cannot write there: {cause}") from error
        if notice and isinstance(error, InputError):
            raise InputError(f"{error}{notice}") from error
        if notice:
            self._log(notice[2:])

    def _publish(self, unfinished: Unfinished) -> None:
        """Put the complete folder in its place, without the record."""
        try:
            unfinished.finish(_WRITTEN, self._force)
        except OSError as failure:
            unfinished.close()
            raise InputError(
                f"{self.path}: cannot put the results there: {failure.strerror}; "
                f"they are in {self.building}"
            ) from None
        # only a resumed track needs the record
        for name in (RECORD, *CARRIED_FILES):
            (self.path / name).unlink(missing_ok=True)

    def _keep_record(self, unfinished: Unfinished) -> str:
        """Keep the record to resume from, but no results: they may be half written.

        Returns a notice of the frames that are kept, or "" if there are none.
        """
        if not self._recorded:
            unfinished.remove(_WRITTEN)
            return ""
        for name in FILES:
            (self.building / name).unlink(missing_ok=True)
        unfinished.close()
        return (
            f"; {self._recorded} finished frames are kept: "
            "the same command with --resume continues from there"
        )

    def _is_about_folder(self, error: OSError) -> bool:
        """Return whether an error is about this folder or the room on its disk.

        An error of another file, such as the footage, speaks for itself.
        """
        is_inside = str(error.filename).startswith(str(self.building))
        return error.errno in NO_ROOM or is_inside

    def earlier(self) -> tuple[list[Frame], dict[str, Any] | None]:
        """Return the frames recorded before, and the random state after the last."""
        frames, state = self._earlier
        return list(frames), state

    def record(self, frame: Frame, state: dict[str, Any]) -> None:
        """Record a frame, and the random state after it."""
        if (kept := frame.details.get(CARRIED)) is not None:
            # the other file, of the frame before, is kept until this frame is recorded
            write_carried(
                self.building / CARRIED_FILES[self._slot], self._recorded, kept
            )
            self._slot = 1 - self._slot
        append_frame(self.building / RECORD, with_carried(frame, None), state)
        self._recorded += 1

    def begin(self, scene: Scene) -> None:
        """Warn before the work if the video of a scene's track cannot be written."""
        if "mp4" not in self._kinds:
            return
        if warning := video_warning(self.building, scene):
            self._log(f"{WARNING}{warning}")

    def finish(self, content: Content) -> None:
        """Write everything, with a warning for each picture that cannot be made."""
        for warning in write_files(self.building, content, self._kinds):
            self._log(f"{WARNING}{warning}")


def _check_target(path: Path, force: bool) -> None:
    """Raise InputError if no folder may be written at a path."""
    opencv_name(path)  # raises if OpenCV cannot write to the path
    if not os.path.lexists(path):
        return
    if path.is_symlink() or not path.is_dir():
        found = "a link" if path.is_symlink() else "a file"
        raise InputError(f"{path}: expected a folder to write to, got {found}")
    if not force:
        raise InputError(
            f"{path}: expected a new folder, got one that exists; --force replaces it"
        )
    if others := other_entries(path, _WRITTEN) or _unmarked(path):
        found = f"one with {cut(others[0])}, which posefit did not write"
        raise InputError(
            f"{path}: expected a folder of earlier results to replace, got {found}"
        )


def _interrupted(path: Path, identity: Mapping[str, Digest]) -> Unfinished:
    """Return the latest unfinished folder of a track with the same arguments."""
    interrupted = Unfinished.interrupted(path)
    if not interrupted:
        raise InputError(f"{path}: expected an interrupted track to resume, got none")
    try:
        others = [difference(folder.info, identity) for folder in interrupted]
    except (AttributeError, TypeError):
        raise InputError(
            f"{interrupted[0].path / MARK}: expected the arguments of a track, "
            "got something else: track without --resume"
        ) from None
    resumed = interrupted[others.index(None)] if None in others else None
    for folder in interrupted:
        if folder is not resumed:
            folder.close()
    if resumed is None:
        raise InputError(f"{path}: {others[0]}")
    return resumed


def _unmarked(folder: Path) -> list[str]:
    """Return the names of the files in a folder that has no summary of a track.

    Empty if it has one, or if the folder is empty.
    """
    names = sorted(entry.name for entry in folder.iterdir())
    try:
        summary = parsed_json(read_text(folder / SUMMARY, MAX_SUMMARY_BYTES))
    except (OSError, ValueError):
        return names
    keys = {"version", "method", "evaluations", "trust"}
    if isinstance(summary, dict) and keys <= summary.keys():
        return []
    return names
