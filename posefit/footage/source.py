"""Turn a source into a scene.

from posefit.footage.options import SourceOptions
from posefit.footage.source import scene_of

scene = scene_of(["a.mp4", "b.mp4"], SourceOptions(camera="cameras.toml"))
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, Self, cast

from posefit.errors import InputError, NoPersonError
from posefit.footage.annotations import ANNOTATIONS
from posefit.footage.cameras import combined, same_person
from posefit.footage.cleaning import cleaned
from posefit.footage.extraction import Extraction
from posefit.footage.kinds import Resolved, resolve
from posefit.footage.options import SourceOptions
from posefit.footage.pairing import calibrated, read_cameras
from posefit.footage.scene import Scene, synthetic
from posefit.footage.segmentation import Segmentation
from posefit.footage.video import Video
from posefit.footage.views import Range, View, range_warning, with_common_frames
from posefit.footage.world import world_of
from posefit.geometry.body import Body
from posefit.geometry.calibration import Calibration
from posefit.geometry.camera import Camera
from posefit.motion import built_in
from posefit.motion.asf import Acclaim, parse_asf
from posefit.motion.clips import FPS, FileOptions, Source, load_motion
from posefit.progress import QUIET, Progress
from posefit.reading import quoted

SIZE = (320, 240)  # width and height of rendered masks, by default


def scene_of(
    source: Any, options: SourceOptions | None = None, progress: Progress = QUIET
) -> Scene:
    """Return the scene of a motion, or of what cameras saw at the same times.

    Several segmenters may be tried on a film. The first one without doubtful masks is
    used, or else the one with the least doubtful masks.

    Args:
        source: As for `resolve`, or its result.
        options: Its cameras, its person, and how it is read.
        progress: Shows the progress of reading.

    Returns:
        The scene, whose guesses are logged.

    Raises:
        InputError: An option does not fit the source, or no segmenter finds a person.
    """
    source = resolve(source)
    options = options or SourceOptions()
    if source.medium == "motion":
        scene = _of_motion(source, options)
    else:
        scene = _of_footage(source, options, progress)
    if warning := range_warning(options.frames, scene.first, scene.count):
        scene = replace(scene, warnings=[*scene.warnings, warning])
    log_guesses(scene, progress)
    return scene


def _of_motion(source: Resolved, options: SourceOptions) -> Scene:
    """Return the scene of a known motion."""
    size = options.size or SIZE
    cameras, guesses = _placed(options, size)
    # `up` and `unit` describe the calibrations if given, or else the motion's file
    of_file = FileOptions(options.asf, rate=options.rate)
    if not cameras:
        of_file = of_file._replace(unit=options.unit, up=options.up)
    (material,) = source.materials
    motion = load_motion(cast(Source, material), options.fps or FPS, of_file)
    return synthetic(motion, options.degrees, size, cameras, options.frames, guesses)


def _of_footage(source: Resolved, options: SourceOptions, progress: Progress) -> Scene:
    """Return the scene of masks or films."""
    if len(options.degrees) > 1:
        raise InputError(
            "view_degrees must be one for footage, of its first camera, "
            f"got {len(options.degrees)}"
        )
    person = FilmedBody.of(options)
    how = _segmented_person(options)
    films = films_of(source, how.width, options.fps)
    filmed: Sequence[tuple[int, int] | None] = [film.filmed for film in films]
    filmed = filmed or [None] * len(source.materials)
    given = calibrated(options.cameras, filmed, source.names)

    def combine(views: Sequence[View]) -> Scene:
        return person.seen(views, given, options)

    if films:
        return _of_films(films, given, how, options.frames, progress, combine)
    wanted = options.label if options.category is None else options.category
    views = views_of_masks(source, options.frames, wanted, options.fps)
    return combine(_of_one_person(views, given, options))


def _segmented_person(options: SourceOptions) -> Extraction:
    """Return how to segment the person whom the options or their extraction choose."""
    how = options.extraction or Extraction()
    if options.person is None:
        return how
    if how.person not in (None, options.person):
        raise InputError(
            "person must be given once, or the same twice, "
            f"got {quoted(options.person)}, and {quoted(how.person)} of the extraction"
        )
    return replace(how, person=options.person)


def _placed(
    options: SourceOptions, size: tuple[int, int]
) -> tuple[list[Camera], list[str]]:
    """Return the cameras around a known motion, and what was guessed about them.

    `size` is used for calibrations that do not state theirs.
    """
    given = read_cameras(options.cameras)
    world, metres, guesses = world_of(given, options.up, options.unit)
    cameras = list[Camera]()
    for each in given:
        if isinstance(each, Calibration):
            each = each.in_metres(metres).camera(each.size or size, world)
        # the rasteriser needs square pixels
        cameras.append(each.squared())
    return cameras, [*guesses.values()]


def log_guesses(scene: Scene, progress: Progress) -> None:
    """Log the guesses of a scene."""
    if scene.guesses:
        progress.log(f"guessed: {'; '.join(scene.guesses)}")


def films_of(source: Resolved, width: int, fps: float | None = None) -> list[Video]:
    """Return the films of a source, one per camera; an empty list if it has masks.

    Args:
        source: The source.
        width: Wider films are scaled down to this width, in pixels.
        fps: Frames per second of pictures.

    Raises:
        InputError: A film cannot be read, or the rates differ.
    """
    films = list[Video]()
    for kind, material in zip(source.kinds, source.materials, strict=True):
        if kind.film is not None:
            films.append(kind.film(material, fps, width))
    # videos that were cut or converted state rates that differ after the third decimal
    rates = sorted({round(film.fps, 3) for film in films})
    if len(rates) > 1:
        came = ", ".join(str(rate) for rate in rates)
        raise InputError(f"videos must have one frame rate, got {came}")
    return films


def views_of_masks(
    source: Resolved,
    frames: Range = (None, None),
    label: int | str | None = None,
    fps: float | None = None,
) -> list[View]:
    """Return the views of a source of masks, one per camera, of the same frames.

    Args:
        source: Masks; other sources have no views yet.
        frames: Which frames to read.
        label: The person's value, for masks with several labels, or category, for
            annotations.
        fps: Frames per second; by default what the source states.

    Raises:
        InputError: Masks cannot be read, or cameras have no frame in common.
    """
    views = list[View]()
    for kind, material in zip(source.kinds, source.materials, strict=True):
        if isinstance(label, str) and not kind.has_categories:
            raise InputError(
                f"category applies only to annotations ({ANNOTATIONS}), "
                f"got {quoted(label)}: leave it out"
            )
        if kind.view is not None:
            views.append(kind.view(material, frames, label, fps))
    return with_common_frames(views)


def _of_one_person(
    views: Sequence[View],
    given: Sequence[Camera | Calibration],
    options: SourceOptions,
) -> list[View]:
    """Return cleaned views of one person: the one that the first view follows."""
    clean = [cleaned(views[0], options.holes, options.person)]
    for k, view in enumerate(views[1:], 1):
        choose = partial(same_person, [given[0], given[k]], clean[0], view.size)
        clean.append(cleaned(view, options.holes, choose))
    return clean


class _Attempt(NamedTuple):
    """What one segmenter made of the films."""

    name: str  # of the segmenter
    scene: Scene | None  # None if it found no person
    doubt: str  # what is wrong with its masks; "" if nothing


def _of_films(
    films: Sequence[Video],
    given: Sequence[Camera | Calibration],
    how: Extraction,
    frames: Range,
    progress: Progress,
    combine: Callable[[Sequence[View]], Scene],
) -> Scene:
    """Return the scene of films. Raises NoPersonError if nobody is found in them."""
    attempts = list[_Attempt]()
    for way in how.ways(len(films)):
        among = how if len(films) == 1 and way is not how else None
        # all are checked before any is read
        parts = [Segmentation(film, way, frames, among) for film in films]
        try:
            views = _segmented(parts, given, progress)
            doubts = [view.doubt for view in views if view.doubt]
            attempt = _Attempt(way.name, combine(views), doubts[0] if doubts else "")
        except NoPersonError as error:
            attempt = _Attempt(way.name, None, str(error))
        attempts.append(attempt)
        if not attempt.doubt:
            break
    # doubtful masks are better than none; of equals, take the first segmenter's
    best = min(attempts, key=lambda each: (each.scene is None, bool(each.doubt)))
    if best.scene is None:
        raise NoPersonError(best.doubt)
    first = attempts[0]
    if best is first:
        return best.scene
    reason, _, _ = first.doubt.partition(";")
    warning = f"segmented by {best.name} instead of {first.name}: {reason}"
    return replace(best.scene, warnings=[*best.scene.warnings, warning])


def _segmented(
    parts: list[Segmentation],
    given: Sequence[Camera | Calibration],
    progress: Progress,
) -> list[View]:
    """Return views of one person: the one that the first film follows.

    Raises NoPersonError if a film's masks cannot be a person's.
    """
    views = list[View]()
    for k in range(len(parts)):
        # a background and the kept frames take much memory: each is freed after use
        part = parts.pop(0)
        progress.log(f"segmenting {part.video.path} by {part.how.name}")
        choose = None
        if views:
            choose = partial(
                same_person,
                [given[0], given[k]],
                views[0],
                part.video.size,
                filmed=part.video.filmed,
            )
        view, _, doubt = part.read(progress.steps, choose, refuse_cut=True)
        if doubt is not None and doubt.refused:
            raise NoPersonError(doubt.text)
        # a track shows the pictures of the first camera only
        views.append(replace(view, pictures=None) if views else view)
    return views


class FilmedBody(NamedTuple):
    """The body of the person in footage, and what to say about it."""

    body: Body
    warnings: Sequence[str]  # about the skeleton's file
    guesses: Sequence[str]

    @classmethod
    def of(cls, options: SourceOptions) -> Self:
        """Return the person of some options, of which `asf` and `height` are used.

        The default is the average skeleton. With a given height there are neither
        warnings nor guesses, because both are about sizes.
        """
        acclaim = Acclaim(built_in.average_skeleton(), 1.0)
        if options.asf is not None:
            # `unit` describes the calibrations if given, or else the skeleton's file
            unit = None if options.cameras else options.unit
            acclaim = parse_asf(options.asf, unit)
        body = Body.of(acclaim.skeleton)
        if options.height is not None:
            factor = options.height / body.stature
            return cls(body.scaled(factor, factor), (), ())
        guesses = []
        if options.asf is None:
            guesses.append(f"a person of {body.stature:.2f} m")
        return cls(body, acclaim.notes, guesses)

    def seen(
        self,
        views: Sequence[View],
        given: Sequence[Camera | Calibration],
        options: SourceOptions,
    ) -> Scene:
        """Return the scene of this person in the views of cameras, see `combined`."""
        scene = combined(views, self.body, given, options)
        return replace(
            scene,
            warnings=[*self.warnings, *scene.warnings],
            guesses=[*scene.guesses, *self.guesses],
        )
