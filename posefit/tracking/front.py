"""`posefit.track` and `posefit.fit`: every option a keyword, sorted here into what the floors below take."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Literal

import numpy as np

from posefit.arrays import Array
from posefit.fitting.check import finite_number, whole
from posefit.fitting.optimiser import OptimiserFactory
from posefit.fitting.prior import Prior
from posefit.fitting.space import Translation
from posefit.fitting.tracker import TrackerFactory
from posefit.footage.masks import Range
from posefit.footage.scene import Scene
from posefit.footage.segmentation import Extraction
from posefit.footage.source import Source, Viewing, kind_of, scene_of
from posefit.footage.training import training_clips, training_motions
from posefit.geometry.calibration import Up
from posefit.geometry.camera import Camera
from posefit.listening import QUIET, Listener
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.reading import quoted
from posefit.silhouette.cuda.device import check_device
from posefit.tracking.identity import Told
from posefit.tracking.method import Choice, usual
from posefit.tracking.opening import Opening
from posefit.tracking.outputs import Nowhere, OutputFolder
from posefit.tracking.run import Track, follow
from posefit.version import __version__

_FILES = ("source", "train", "asf", "cameras", "extraction")  # what may name files, whose content counts


@dataclass(frozen=True, eq=False)
class Fit:
    """The pose found in one frame."""

    pose: Array = field(repr=False)  # (66,)
    translation: Array  # (3,) metres
    cost: float
    history: Array = field(repr=False)  # (populations,) best cost after each
    summary: dict[str, Any] = field(repr=False)


def track(
    source: Source | Scene | Sequence[Source] = "walk",
    *,
    asf: str | Path | None = None,
    camera: Camera | str | Path | Sequence[Camera | str | Path] | None = None,
    optimiser: str | OptimiserFactory | None = None,
    prior: str | Prior | None = None,
    tracker: str | TrackerFactory | None = None,
    train: Sequence[Source] = (),
    view_degrees: float | Sequence[float] | None = None,
    size: tuple[int, int] | None = None,
    fps: float | None = None,
    frames: Range = (None, None),
    particles: int | None = None,
    iterations: int | None = None,
    evaluations: int | None = None,
    translation: Translation | None = None,
    first_pose: Literal["searched", "given"] = "searched",
    restarts: int | None = None,
    body_frames: int | None = None,
    height: float | None = None,
    extraction: Extraction | None = None,
    label: int | None = None,
    holes: float | None = None,
    up: Up | None = None,
    tracks: int = 1,
    steady: bool | None = None,
    passes: int = 1,
    seed: int = 0,
    threads: int = 1,
    device: str = "cpu",
    ask_seconds: float | None = None,
    optimiser_settings: Mapping[str, Any] | None = None,
    prior_settings: Mapping[str, Any] | None = None,
    tracker_settings: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    force: bool = False,
    resume: bool = False,
    rerun: str | Path | None = None,
    progress: Callable[[Iterator[Any], int], Iterator[Any]] | None = None,
    say: Callable[[str], None] | None = None,
) -> Track:
    """Return the motion followed through a source's silhouettes, with its errors where the truth is known.

    `source` is a built-in motion's name, a recorded one's, a `Motion`, an .amc or .bvh file, a folder of mask images,
    an .npz of masks, a video, or several masks or videos that cameras took at the same time; or a `Scene` of a known
    motion, as it is. The method is `optimiser` with `prior`, or `tracker`, and `train` names the motions that it learns
    from: built-in or recorded ones, files, folders of them, or people of the library, such as `library:-16`. The budget
    of a frame is `evaluations`, by default particles x (iterations + 1) = 40 x 61, the same for every method.
    `translation` is "known" where the truth is, else "aligned". A `first_pose` that is "given" starts the first frame
    around the true one. `ask_seconds` is how long a plugin may take to propose a population. Poses are drawn on a
    `device`, "cpu" or "cuda".

    Where the truth is known the method is `sapso` with `pca`, which learns from the other styles of a built-in
    motion, else from the built-in walks. Where it is not, it is the tracker `exemplars`, which learns from the
    library; or, if an optimiser or a prior is given, `sapso` with `loose`, which learns from the built-in walks.
    There the first frame is searched `restarts` times (8; 0 for a tracker that looks ahead), and the person's build
    is fitted to `body_frames` (12; none where an .asf is given), as tall as `height` says. With several `tracks`
    the person is followed so many times from different beginnings, each at the full budget, and the track is kept
    whose whole cost is least. A track is `steady` where nobody knows the truth: its root goes smoothly, and feet
    that stand stay where they are; False leaves what was found in each frame. It is followed in so many `passes`:
    each after the first knows the root's way and the build that were fitted before.
    `view_degrees` gives where the camera stands, several of them several cameras; `camera` is a camera or a
    calibration, one a view, in whose world `up` points up; `extraction` is how masks are taken from video. `label`
    is the value that the person has in masks of several things, and `holes` the largest that is filled, a share of
    him.

    With `out`, a new folder gets poses, .amc, .bvh, .trc, .c3d, tables, a video and a picture; it appears whole or
    not at all. What was found when a track ended too early is kept, and `resume` goes on from there. `rerun` is where a
    recording for the Rerun viewer goes. Raises ValueError for every mistake in the arguments or files.
    """
    sources = _sources(source)
    _check_numbers(
        particles=particles,
        iterations=iterations,
        evaluations=evaluations,
        restarts=restarts,
        body_frames=body_frames,
        tracks=tracks,
        passes=passes,
        seed=seed,
        threads=threads,
        ask_seconds=ask_seconds,
    )
    check_device(device)
    if isinstance(train, str | Path | Motion):
        raise ValueError(f"train must be a list of motions, got {quoted(train)}")
    viewing = Viewing(
        asf=asf,
        cameras=() if camera is None else (camera,) if isinstance(camera, Camera | str | Path) else tuple(camera),
        view_degrees=_angles(view_degrees),
        size=size,
        fps=fps,
        frames=frames,
        extraction=extraction,
        height=height,
        up=up,
        label=label,
        holes=holes,
    )
    if isinstance(source, Scene) and viewing != Viewing():
        raise ValueError(f"a scene must be followed as it is, got {viewing}")
    searched = bool(optimiser_settings or prior_settings)
    chosen = usual(sources[0], optimiser=optimiser, prior=prior, tracker=tracker, train=train, searched=searched)
    choice = Choice(
        **chosen.method,
        optimiser_settings=optimiser_settings or {},
        prior_settings=prior_settings or {},
        tracker_settings=tracker_settings or {},
        particles=particles,
        iterations=iterations,
        evaluations=evaluations,
        ask_seconds=ask_seconds,
    )
    choice.budget()
    opening = Opening(
        translation=translation,
        first_pose=first_pose,
        restarts=restarts,
        body_frames=0 if body_frames is None and asf is not None else body_frames,
        height=height,
    )
    kind = kind_of(sources[0])
    viewing.check_used(kind)
    if kind == "motion":
        _check_known(asf, restarts, [*sources, *train])
    opening.check(kind == "motion")
    clips = training_clips(chosen.train, asf, followed=sources[0])  # before the work, as a name may be wrong
    if resume and out is None:
        raise ValueError("resume must be given with out, the folder of the track that goes on, got none")
    if rerun is not None:
        from posefit.tracking.recording import check_recording

        check_recording(rerun)
    listener = Listener(say or QUIET.say, progress or QUIET.progress)
    folder: AbstractContextManager[Nowhere | OutputFolder] = Nowhere()
    if out is not None:
        folder = OutputFolder(
            out, force, resume, _told(sources, train, viewing, choice, opening, tracks, seed), listener.say
        )
    with folder as output:
        scene = source if isinstance(source, Scene) else scene_of(sources, viewing, listener)
        result = follow(
            scene,
            training_motions(clips, scene.fps),
            choice=choice,
            opening=opening,
            seed=seed,
            threads=threads,
            device=device,
            output=output,
            listener=listener,
            source={
                "source": [one.name if isinstance(one, Motion) else str(one) for one in sources],
                "frames_chosen": list(frames),
                "view_degrees": view_degrees,
            },
            tracks=tracks,
            steady=steady,
            passes=passes,
        )
        if rerun is not None:
            from posefit.tracking.recording import record

            record(rerun, scene, result.motion, result.found)
    return result


def _check_numbers(seed: int, threads: int, ask_seconds: float | None, **counts: int | None) -> None:
    """Return nothing. Raises ValueError where one of them is not the number that it has to be."""
    whole("seed", seed, 0)
    whole("threads", threads, 1)
    if ask_seconds is not None:
        finite_number("ask_seconds", ask_seconds)
    for name, value in counts.items():
        if value is not None:
            whole(name, value, 0 if name in ("restarts", "body_frames") else 1)


def _angles(degrees: float | Sequence[float] | None) -> Sequence[float]:
    if degrees is None:
        return ()
    each = list(degrees) if isinstance(degrees, Sequence | np.ndarray) and not isinstance(degrees, str) else [degrees]
    return [finite_number("view_degrees", one) for one in each]


def _check_known(asf: str | Path | None, restarts: int | None, motions: Sequence[Source]) -> None:
    """Return nothing. Raises ValueError where something was given that a known motion has no use for."""
    if asf is not None and not any(str(one).lower().endswith(".amc") for one in motions if isinstance(one, str | Path)):
        raise ValueError(f"asf must be given for .amc files and footage only, got {quoted(str(asf))}")
    if restarts == 0:
        raise ValueError("restarts must be at least 1 for a motion, which is searched once where it is left out, got 0")


def fit(source: Source | Sequence[Source] = "walk", *, frame: int = 0, **settings: Any) -> Fit:
    """Return the pose found in one frame of a source; settings as for `track`, but for `frames`."""
    frame = whole("frame", frame, 0)
    result = track(source, frames=(frame, frame + 1), **settings)
    history = np.array(result.summary.pop("history"))
    return Fit(result.motion.poses[0], result.motion.translations[0], result.measures.cost, history, result.summary)


def _sources(source: Source | Scene | Sequence[Source]) -> Sequence[Source]:
    if isinstance(source, Scene):
        if source.truth is None:
            raise ValueError(f"a scene must be of a known motion, got {source.name}, whose truth nobody knows")
        return [source.truth]
    return source if isinstance(source, Sequence) and not isinstance(source, str) else [source]


def _told(
    sources: Sequence[Source],
    train: Sequence[Source],
    viewing: Viewing,
    choice: Choice,
    opening: Opening,
    tracks: int,
    seed: int,
) -> dict[str, Told]:
    """Return what a track has to have in common with one that it goes on with."""
    told: dict[str, Any] = {"source": sources, "train": train, "tracks": tracks, "seed": seed, "version": __version__}
    for group in (viewing, choice, opening):
        told |= {one.name: getattr(group, one.name) for one in fields(group)}
    if kind_of(sources[0]) == "motion" and sources[0] in built_in.names():
        return {name: Told.of(value, files=name in _FILES and name != "source") for name, value in told.items()}
    return {name: Told.of(value, files=name in _FILES) for name, value in told.items()}
