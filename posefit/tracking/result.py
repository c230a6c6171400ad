"""What a track gives: frames and motion, errors or signs of trust, a table, pictures and files; and one frame, a fit.

Everything but `save`, `page` and `show` is a plain value, and pickles.
"""

import importlib
import webbrowser
from dataclasses import dataclass, field, fields
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
from posefit.output.files import page_of
from posefit.output.folder import OutputFolder
from posefit.output.text import table
from posefit.progress import interactive
from posefit.reading import quoted, suggestion
from posefit.uncertainty.modes import TrackMode

if TYPE_CHECKING:
    import pandas as pd
    from PIL.Image import Image

INLINE_HEIGHT = 720  # pixels of the page in a notebook


@dataclass(frozen=True, eq=False)
class Track:
    """A tracked motion with its errors or signs of trust."""

    motion: Motion  # the estimate
    frames: list[Frame] = field(repr=False)  # the tracker's, smoothed
    # a column (T,) for each figure of a frame: see posefit.evaluation.errors.FRAME
    table: Table = field(repr=False)
    measures: Measures = field(repr=False)
    trust: Trust | None = field(repr=False)  # where the truth is unknown
    gait: Gait = field(repr=False)
    setup: Setup = field(repr=False)
    log: TrackingLog = field(repr=False)
    # of the whole track, the likeliest first
    modes: list[TrackMode] = field(repr=False)
    scene: Scene = field(repr=False)

    def __len__(self) -> int:
        return len(self.frames)

    def __str__(self) -> str:
        return table(self.content)

    @property
    def summary(self) -> dict[str, Any]:
        """Everything but the frames, as `posefit track --json` prints it."""
        return self.content.summary

    @property
    def content(self) -> Content:
        """What its files are made of."""
        return Content(
            **{each.name: getattr(self, each.name) for each in fields(Content)}
        )

    @property
    def truth(self) -> Motion | None:
        """The true motion, where it is known."""
        return self.scene.truth

    @property
    def unseen(self) -> set[int]:
        """The frames that were held or are called lost: their numbers as filmed, as in `log.lost_frames`."""
        return unseen(self.table)

    @property
    def joints(self) -> Array:
        """The joints (T, 27, 3) in the world, in metres, in the order of `joint_names`."""
        return self.motion.joints

    @property
    def joint_names(self) -> tuple[str, ...]:
        """What the 27 joints are, such as `left_knee`."""
        return PLACES

    @property
    def activity(self) -> list[str | None]:
        """What the person does in each frame, such as `walk`; None where the method does not say."""
        return [frame.activity for frame in self.frames]

    @property
    def unknown_sides(self) -> NDArray[np.bool_]:
        """In which frames (T,) left and right are unknown; between two of these they may be exchanged as well."""
        return np.isin(self.table["frame"], self.log.unknown_sides or [])

    def angles(self, name: str) -> Array:
        """Return a clinical angle (T,) such as `left_knee_flexion`, in degrees; NaN where the frame shows nothing.

        Where sides are unknown, see `unknown_sides`, the left one may be the right one. Raises InputError listing the
        names where there is none of that name.
        """
        angles = self._angles()
        if name not in angles:
            raise InputError(
                f"angle must be one of {', '.join(angles)}, got {quoted(name)}{suggestion(name, angles)}"
            )
        return angles[name]

    def _angles(self) -> dict[str, Array]:
        return angle_columns(self.motion, self.unseen)

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table of one row a frame: measures, joints in metres, angles in degrees.

        Columns are those of frames.csv and angles.csv. Joints and angles are NaN where a frame was held or is called
        lost; `joints` and `motion` have them there, too. Raises ImportError where pandas is not installed.
        """
        table: pd.DataFrame = import_pandas().DataFrame(
            {**self.content.columns, **self._angles()}
        )
        return table

    def frame(self, k: int) -> "Fit":
        """Return frame k alone. Raises InputError where there is none."""
        if not -len(self) <= k < len(self):
            raise InputError(f"frame must lie in 0 to {len(self) - 1}, got {k}")
        return Fit(self, range(len(self))[k])

    def show(self) -> Any:
        """Open the page of the track, in which the body turns: in a notebook inline, elsewhere in a browser."""
        page = self.page()
        try:
            shell = importlib.import_module("IPython").get_ipython()
        except ImportError:
            shell = None
        if shell is not None and hasattr(shell, "kernel"):
            from html import escape

            frame = f'<iframe srcdoc="{escape(page)}" width="100%" height="{INLINE_HEIGHT}" style="border:0"></iframe>'
            return importlib.import_module("IPython.display").HTML(frame)
        path = Path(mkdtemp(prefix="posefit-")) / "track.html"
        path.write_text(page, encoding="utf-8", newline="\n")
        webbrowser.open(path.as_uri())
        return path

    def page(self) -> str:
        """Return the page that `show` opens and that `save` writes as track.html."""
        return page_of(self.content)

    def save(self, folder: str | Path, force: bool = False) -> None:
        """Write every file of a track to a new folder, or with `force` over earlier ones."""
        with OutputFolder(folder, force, False, {}, interactive().log) as output:
            output.finish(self.content)


@dataclass(frozen=True, eq=False)
class Fit:
    """The estimated pose of one frame, number `k` of a track."""

    track: Track = field(repr=False)
    k: int

    @property
    def frame(self) -> Frame:
        """What the tracker estimated."""
        return self.track.frames[self.k]

    @property
    def pose(self) -> Array:
        """The pose (66,) in radians."""
        return self.frame.pose

    @property
    def translation(self) -> Array:
        """The root's place (3,) in metres."""
        return self.frame.translation

    @property
    def cost(self) -> float:
        """The silhouette mismatch, 0 to 100. SAPSO (4)."""
        return self.frame.cost

    @property
    def iou(self) -> float:
        """The overlap of body and mask, the mean over the views."""
        return float(self.track.table["iou"][self.k])

    @property
    def summary(self) -> dict[str, Any]:
        """The summary of its track."""
        return self.track.summary

    @property
    def joints(self) -> Array:
        """The joints (27, 3) in the world, in metres."""
        return np.asarray(self.track.joints[self.k])

    def overlay(self, ax: Any = None) -> "Image":
        """Return the body drawn on the masks, or on the picture; with `ax`, shown on these axes of matplotlib."""
        from PIL import Image

        from posefit.output.picture import Painter

        scene = self.track.scene
        filmed = None
        if scene.pictures is not None:
            filmed = next(
                picture for k, picture in enumerate(scene.pictures()) if k == self.k
            )
        painted = Painter(scene).overlay(self.frame, scene.observations[self.k], filmed)
        image = Image.fromarray(painted[..., ::-1])
        if ax is not None:
            ax.imshow(image)
            ax.set_axis_off()
        return image
