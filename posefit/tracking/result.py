"""The results `Track` and `Fit`.

A track has frames and a motion, errors or signs of trust, a table, pictures and files.
A fit is one frame of it. Both can be pickled.
"""

import importlib
import webbrowser
from dataclasses import dataclass, field, fields
from itertools import islice
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.evaluation.errors import Table, unseen
from posefit.evaluation.measures import Measures
from posefit.evaluation.trust import Trust
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.measuring.centres import PLACES
from posefit.measuring.gait import Gait
from posefit.measuring.tables import angle_columns, import_pandas
from posefit.motion.motion import Motion
from posefit.output.content import Content, Setup, TrackingLog
from posefit.output.folder import OutputFolder
from posefit.output.pictures import page_of
from posefit.output.text import detailed
from posefit.progress import interactive
from posefit.reading import quoted, suggestion
from posefit.uncertainty.modes import TrackMode

if TYPE_CHECKING:
    import pandas as pd
    from PIL.Image import Image

INLINE_HEIGHT = 720  # pixels of the page in a notebook


@dataclass(frozen=True, eq=False)
class Track:
    """A tracked motion with its errors or signs of trust.

    Attributes:
        motion: The estimate.
        frames: The tracker's frames, smoothed.
        table: A column (T,) for each figure of a frame, as in
            `posefit.evaluation.errors.FRAME`.
        measures: The figures of the whole track.
        trust: The signs of trust, or None if the truth is known.
        gait: The gait.
        setup: The arguments and circumstances.
        log: The course of the track.
        modes: Other likely motions of the whole track, the likeliest first.
        scene: The tracked scene.

    Example:
        >>> import posefit
        >>> track = posefit.track("walk", frames=(0, 2), evaluations=80)
        >>> track.joints.shape, track.angles("left_knee_flexion").shape
        ((2, 27, 3), (2,))
    """

    motion: Motion
    frames: list[Frame] = field(repr=False)
    table: Table = field(repr=False)
    measures: Measures = field(repr=False)
    trust: Trust | None = field(repr=False)
    gait: Gait = field(repr=False)
    setup: Setup = field(repr=False)
    log: TrackingLog = field(repr=False)
    modes: list[TrackMode] = field(repr=False)
    scene: Scene = field(repr=False)

    def __len__(self) -> int:
        return len(self.frames)

    def __str__(self) -> str:
        return detailed(self.content)

    @property
    def summary(self) -> dict[str, Any]:
        """The content of `posefit track --json`: everything except the frames."""
        return self.content.summary

    @property
    def content(self) -> Content:
        """The data from which the files are made."""
        return Content(
            **{each.name: getattr(self, each.name) for each in fields(Content)}
        )

    @property
    def truth(self) -> Motion | None:
        """The true motion, or None if it is unknown."""
        return self.scene.truth

    @property
    def unseen(self) -> set[int]:
        """The numbers, as filmed, of the frames that were held or are lost."""
        return unseen(self.table)

    @property
    def joints(self) -> Array:
        """The joints (T, 27, 3) in metres in the world, ordered as `joint_names`."""
        return self.motion.joints

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The names of the 27 joints, such as `left_knee`."""
        return PLACES

    @property
    def activity(self) -> list[str | None]:
        """The activity in each frame, such as `walk`.

        It is None if the method does not report it.
        """
        return [frame.activity for frame in self.frames]

    @property
    def unknown_sides(self) -> NDArray[np.bool_]:
        """Whether left and right are unknown, for each frame (T,).

        Between two such frames they may be exchanged, too.
        """
        return np.isin(self.table["frame"], self.log.unknown_sides or [])

    def angles(self, name: str) -> Array:
        """Return a clinical angle over time.

        In frames of `unknown_sides` left and right may be exchanged.

        Args:
            name: Such as `left_knee_flexion`.

        Returns:
            Degrees (T,), NaN in `unseen` frames.

        Raises:
            InputError: The name is unknown; the message lists all names.
        """
        angles = self._angles()
        if name not in angles:
            hint = suggestion(name, angles)
            raise InputError(
                f"angle must be one of {', '.join(angles)}, got {quoted(name)}{hint}"
            )
        return angles[name]

    def _angles(self) -> dict[str, Array]:
        return angle_columns(self.motion, self.unseen)

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table with one row per frame: measures, joints and angles.

        The columns are as in frames.csv and angles.csv: joints in metres and angles in
        degrees. They are NaN in `unseen` frames, for which `joints` and `motion` still
        have values. Raises ImportError if pandas is not installed.
        """
        columns = {**self.content.columns, **self._angles()}
        table: pd.DataFrame = import_pandas().DataFrame(columns)
        return table

    def frame(self, k: int) -> "Fit":
        """Return frame k alone. Raises InputError if there is no such frame."""
        if not -len(self) <= k < len(self):
            raise InputError(f"frame must lie in 0 to {len(self) - 1}, got {k}")
        return Fit(self, range(len(self))[k])

    def show(self) -> Any:
        """Show the page of the track inline in a notebook, or else in a browser.

        Returns:
            The page as a notebook displays it, or else the path of its file.
        """
        page = self.page()
        try:
            shell = importlib.import_module("IPython").get_ipython()
        except ImportError:
            shell = None
        if shell is not None and hasattr(shell, "kernel"):
            from html import escape

            frame = (
                f'<iframe srcdoc="{escape(page)}" width="100%" '
                f'height="{INLINE_HEIGHT}" style="border:0"></iframe>'
            )
            return importlib.import_module("IPython.display").HTML(frame)
        path = Path(mkdtemp(prefix="posefit-")) / "track.html"
        path.write_text(page, encoding="utf-8", newline="\n")
        webbrowser.open(path.as_uri())
        return path

    def page(self) -> str:
        """Return the page that `show` opens and that `save` writes as track.html."""
        return page_of(self.content)

    def save(self, folder: str | Path, force: bool = False) -> None:
        """Write every file of the track.

        Args:
            folder: A new folder, or with `force` a folder of earlier results.
            force: Whether earlier results are replaced.

        Raises:
            InputError: The folder may not be written.
        """
        with OutputFolder(folder, force, False, {}, interactive().log) as output:
            output.finish(self.content)


@dataclass(frozen=True, eq=False)
class Fit:
    """The estimated pose of one frame, number `k` of a track.

    Attributes:
        track: The track of one frame.
        k: The number of the frame in the track.

    Example:
        >>> import posefit
        >>> posefit.fit("walk", frame=3, evaluations=80).pose.shape
        (66,)
    """

    track: Track = field(repr=False)
    k: int

    @property
    def frame(self) -> Frame:
        """The tracker's estimate."""
        return self.track.frames[self.k]

    @property
    def pose(self) -> Array:
        """The pose (66,) in radians."""
        return self.frame.pose

    @property
    def translation(self) -> Array:
        """The position (3,) of the root in metres."""
        return self.frame.translation

    @property
    def cost(self) -> float:
        """The silhouette mismatch, 0 to 100. SAPSO (4)."""
        return self.frame.cost

    @property
    def iou(self) -> float:
        """The overlap (IoU) of body and mask, as the mean over the views."""
        return float(self.track.table["iou"][self.k])

    @property
    def summary(self) -> dict[str, Any]:
        """The summary of the track."""
        return self.track.summary

    @property
    def joints(self) -> Array:
        """The joints (27, 3) in the world, in metres."""
        return np.asarray(self.track.joints[self.k])

    def overlay(self, ax: Any = None) -> "Image":
        """Return a picture of the body on the footage, or on the masks.

        Args:
            ax: Axes of matplotlib that show the picture, or None.

        Returns:
            The picture.
        """
        from PIL import Image

        from posefit.output.picture import Painter

        scene = self.track.scene
        filmed = None
        if scene.pictures is not None:
            filmed = next(islice(scene.pictures(), self.k, None))
        painted = Painter(scene).overlay(self.frame, scene.observations[self.k], filmed)
        image = Image.fromarray(painted[..., ::-1])
        if ax is not None:
            ax.imshow(image)
            ax.set_axis_off()
        return image
