"""Decoded frames that are needed again, in a temporary file.

A film is read up to four times: for the times of its frames, to learn the background,
to segment the person, and to show the track. It is decoded once.
"""

import weakref
from collections.abc import Container
from tempfile import TemporaryFile
from typing import IO, Any

import numpy as np

from posefit.silhouette.foreground import Image

# bytes of the file of one film, 430 frames of 640x360 pixels: other frames are decoded
# again
ROOM = 300_000_000


class KeptFrames:
    """Frames of one size by their number, up to `ROOM` bytes of them.

    They are in a file, because even a short film would double the memory of a track.
    Packed with zlib they would take a fifth of the room, but packing and unpacking take
    longer than decoding most films again.
    """

    def __init__(self, size: tuple[int, int], wanted: Container[int]) -> None:
        """Keep nothing yet.

        Args:
            size: Width and height of the frames.
            wanted: The numbers of the frames to keep; the others are not added.
        """
        self.wanted = wanted
        self._shape = (size[1], size[0], 3)
        self._bytes = 3 * size[0] * size[1]  # of a frame
        self._places = dict[int, int]()  # the bytes before each frame, by its number
        self._file: IO[bytes] | None = None
        self._room = ROOM

    def __reduce__(self) -> Any:
        # another process decodes the film again
        return KeptFrames, (self._shape[1::-1], ())

    def __contains__(self, number: object) -> bool:
        return number in self._places

    def takes(self, number: int) -> bool:
        """Return whether a frame would be kept if it was added."""
        is_new = number in self.wanted and number not in self._places
        return is_new and self._room >= self._bytes

    def add(self, number: int, frame: Image) -> None:
        """Keep a frame, if it is wanted and there is room."""
        if not self.takes(number):
            return
        try:
            if self._file is None:
                # closed with this object, or Python would warn of an open file
                self._file = TemporaryFile(buffering=0)  # noqa: SIM115
                weakref.finalize(self, self._file.close)
            place = ROOM - self._room
            self._file.seek(place)
            whole = self._file.write(np.ascontiguousarray(frame).data) == frame.nbytes
        except OSError:
            whole = False
        if not whole:  # the disk is full, or there is none for temporary files
            self._room = 0
            return
        self._places[number] = place
        self._room -= frame.nbytes

    def __getitem__(self, number: int) -> Image:
        """Return a new copy of a frame that was kept."""
        assert self._file is not None
        frame = np.empty(self._shape, dtype=np.uint8)
        self._file.seek(self._places[number])
        read = self._file.readinto(frame)  # type: ignore[attr-defined]
        assert read == frame.nbytes
        return frame
