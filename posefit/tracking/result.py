"""What a track gives: its motion, errors or signs of trust, tables, pictures and files; and one frame of it, a fit."""

import importlib
import webbrowser
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.geometry.body import Body
from posefit.measuring.centres import PLACES
from posefit.motion.motion import Motion
from posefit.progress import QUIET
from posefit.reading import quoted, suggestion
from posefit.tracking.evaluation import unseen
from posefit.tracking.measures import Measures
from posefit.tracking.table import brief, table
from posefit.uncertainty.modes import TrackMode

if TYPE_CHECKING:
    import pandas as pd
    from PIL.Image import Image

INLINE_HEIGHT = 720  # pixels of the page in a notebook


@dataclass(frozen=True, eq=False)
class Track:
    """A tracked motion with its errors or signs of trust."""

    motion: Motion  # the estimate
    truth: Motion | None = field(repr=False)
    measures: Measures = field(repr=False)
    frames: list[dict[str, float]] = field(repr=False)  # one row a frame: see posefit.tracking.measures.FRAME
    summary: dict[str, Any] = field(repr=False)  # what `posefit track --json` prints
    estimates: list[Frame] = field(repr=False)  # the tracker's frames, smoothed
    scene: Scene = field(repr=False)
    modes: list[TrackMode] = field(default_factory=list, repr=False)  # of the whole track, the likeliest first

    def __len__(self) -> int:
        return len(self.estimates)

    def __str__(self) -> str:
        return table(self.summary)

    @property
    def trust(self) -> str:
        """Whether the track can be trusted, in one sentence; where the truth is known, its errors."""
        return brief(self.summary)[0]

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
        return [frame.activity for frame in self.estimates]

    @property
    def unknown_sides(self) -> NDArray[np.bool_]:
        """In which frames (T,) left and right are unknown; between two of these they may be exchanged as well."""
        return np.isin(self.scene.first + np.arange(len(self)), self.summary["unknown_sides"] or [])

    def angles(self, name: str) -> Array:
        """Return a clinical angle (T,) such as `left_knee_flexion`, in degrees; NaN where the frame shows nothing.

        Where sides are unknown, see `unknown_sides`, the left one may be the right one. Raises InputError listing the
        names where there is none of that name.
        """
        angles = self._angles()
        if name not in angles:
            raise InputError(f"angle must be one of {', '.join(angles)}, got {quoted(name)}{suggestion(name, angles)}")
        return angles[name]

    def _angles(self) -> dict[str, Array]:
        from posefit.measuring.angles import clinical_angles

        angles = clinical_angles(self.motion.skeleton, self.motion.poses)
        blank = np.isin(np.arange(len(self)), list(unseen(self.frames)))
        return {name: np.where(blank, np.nan, values) for name, values in angles.items()}

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table of one row a frame: seconds of the footage, measures, angles in degrees, joints in metres.

        Columns are those of frames.csv and angles.csv. Raises ImportError where pandas is not installed.
        """
        from posefit.measuring.tables import import_pandas

        rows = {name: [row[name] for row in self.frames] for name in self.frames[0] if name != "cpu_seconds"}
        axes = [f"{place}_{axis}" for place in PLACES for axis in "xyz"]
        points = dict(zip(axes, self.joints.reshape(len(self), -1).T, strict=True))
        seconds = (self.motion.first + np.arange(len(self))) / self.motion.fps
        table: pd.DataFrame = import_pandas().DataFrame(
            {**rows, "seconds": seconds, "activity": self.activity, **self._angles(), **points}
        )
        return table

    def frame(self, k: int) -> "Fit":
        """Return frame k alone. Raises InputError where there is none."""
        if not -len(self) <= k < len(self):
            raise InputError(f"frame must lie in 0 to {len(self) - 1}, got {k}")
        frame, row = self.estimates[k], self.frames[k]
        summary = {name: value for name, value in self.summary.items() if name != "history"}
        return Fit(frame.pose, frame.translation, row["cost"], row["iou"], frame.history, summary, self, k)

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
        from posefit.tracking.outputs import page_of

        return page_of(self.scene, self.estimates, self.frames, self.summary)

    def save(self, folder: str | Path, force: bool = False) -> None:
        """Write every file of a track to a new folder, or with `force` over earlier ones."""
        from posefit.tracking.outputs import OutputFolder

        with OutputFolder(folder, force, False, {}, QUIET.log) as output:
            output.finish(self.scene, self.estimates, self.frames, self.summary)


@dataclass(frozen=True, eq=False)
class Fit:
    """The estimated pose of one frame."""

    pose: Array = field(repr=False)  # (66,) radians
    translation: Array  # (3,) metres
    cost: float
    iou: float
    history: Array = field(repr=False)  # (populations,) best cost after each
    summary: Mapping[str, Any] = field(repr=False)
    track: Track = field(repr=False)
    k: int = field(repr=False)

    @property
    def body(self) -> Body:
        """The body that was fitted."""
        return self.track.scene.body

    @property
    def joints(self) -> Array:
        """The joints (27, 3) in the world, in metres."""
        return np.asarray(self.track.joints[self.k])

    def overlay(self, ax: Any = None) -> "Image":
        """Return the body drawn on the masks, or on the picture; with `ax`, shown on these axes of matplotlib."""
        from PIL import Image

        from posefit.tracking.picture import Painter

        scene = self.track.scene
        filmed = None
        if scene.pictures is not None:
            filmed = next(picture for k, picture in enumerate(scene.pictures()) if k == self.k)
        painted = Painter(scene).overlay(self.track.estimates[self.k], scene.observations[self.k], filmed)
        image = Image.fromarray(painted[..., ::-1])
        if ax is not None:
            ax.imshow(image)
            ax.set_axis_off()
        return image
