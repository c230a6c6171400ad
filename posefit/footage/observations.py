"""What a tracker gets of each frame: its silhouettes, decoded on demand."""

from collections import OrderedDict
from collections.abc import Sequence
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.tracker import Observation
from posefit.footage.views import View
from posefit.geometry.skeleton import JOINTS
from posefit.silhouette.mask import Silhouette

# cache of decoded masks: large enough for a short film
DECODED_BYTES = 64_000_000
# a decoded silhouette per pixel: two arrays of bytes, and two of bits
BYTES_PER_PIXEL = 2.25


class Observations(Sequence[Observation]):
    """The observations of several views of the same frames, decoded on demand.

    A frame is usable if at least one camera saw enough of the person; the silhouettes
    of the other cameras are then unknown.
    """

    def __init__(self, views: Sequence[View], yaws: Array | None = None) -> None:
        """Pair the frames of views.

        Args:
            views: One view per camera, starting at the same frame.
            yaws: (T,) about which way the person faces, in radians. NaN if unknown for
                a frame; None if unknown for all.
        """
        self.views = views
        self.yaws = np.empty(0) if yaws is None else yaws
        self._count = min(map(len, views))
        self.usable = np.any([view.usable[: self._count] for view in views], axis=0)
        pixels = sum(view.size[0] * view.size[1] for view in views)
        self._most = max(DECODED_BYTES // int(BYTES_PER_PIXEL * pixels), 1)
        self._decoded = OrderedDict[int, list[Silhouette]]()

    def __reduce__(self) -> Any:
        return Observations, (self.views, self.yaws)

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        if not 0 <= k < len(self):
            raise IndexError(k)
        known = k < len(self.yaws) and np.isfinite(self.yaws[k])
        return Observation(
            _Silhouettes(self, k),
            usable=bool(self.usable[k]),
            yaw=float(self.yaws[k]) if known else None,
            landmarks=self._landmarks(k),
        )

    def _landmarks(self, k: int) -> Array | None:
        """Return the landmarks (views, 27, 3) of frame k; None if no view has any."""
        if all(view.landmarks is None for view in self.views):
            return None
        landmarks = np.zeros((len(self.views), len(JOINTS), 3))
        for place, view in enumerate(self.views):
            if view.landmarks is not None:
                landmarks[place] = view.landmarks[k]
        return landmarks

    @property
    def first(self) -> int:
        """The first frame that is usable in all cameras, or else in any camera.

        Raises InputError if no frame is usable.
        """
        usable = np.array([view.usable[: len(self)] for view in self.views])
        for enough in (usable.all(axis=0), usable.any(axis=0)):
            if enough.any():
                return int(enough.argmax())
        view = self.views[0]
        raise InputError(
            f"{view.name}: no frame from {view.numbers[0]} on shows enough of the "
            "person"
        )

    def silhouettes(self, k: int) -> list[Silhouette]:
        """Return the silhouettes of frame k, one per view. The latest are cached."""
        silhouettes = self._decoded.pop(k, None)
        if silhouettes is None:
            silhouettes = [self._silhouette(view, k) for view in self.views]
        # at the end, because the first ones are forgotten first
        self._decoded[k] = silhouettes
        while len(self._decoded) > self._most:
            self._decoded.popitem(last=False)
        return silhouettes

    def _silhouette(self, view: View, k: int) -> Silhouette:
        """Return a view's silhouette of frame k; one of several may be unknown."""
        if len(self.views) > 1 and not view.usable[k]:
            unknown = np.zeros(view.size[::-1], dtype=bool)
            return Silhouette.of(unknown, unknown)
        return view.silhouette(k)


class _Silhouettes(Sequence[Silhouette]):
    """The silhouettes of one frame, decoded on first use.

    Asking whether a frame is usable decodes nothing.
    """

    def __init__(self, observations: Observations, k: int) -> None:
        self._observations = observations
        self._k = k

    def __reduce__(self) -> Any:
        return list, ([*self],)

    def __len__(self) -> int:
        return len(self._observations.views)

    def __getitem__(self, number):  # type: ignore[no-untyped-def]
        return self._observations.silhouettes(self._k)[number]
