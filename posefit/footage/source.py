"""Recognise what a user names, and turn it into a scene.

    from posefit.footage.source import resolve, scene_of

    source = resolve(["a.mp4", "b.mp4"])     # finds the kind, and the files per camera
    scene = scene_of(source, camera=["cameras.toml"])

Each kind of source is a line of `KINDS`: how it is recognised, and its reader. A reader
returns a `View`, or a film that a segmenter turns into a `View`.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from posefit.errors import InputError, NoPersonError
from posefit.files import opencv_name
from posefit.footage.cameras import (
    calibrated,
    combined,
    listed,
    same_person,
    world_of,
)
from posefit.footage.cleaning import cleaned
from posefit.footage.extraction import Extraction
from posefit.footage.images import IMAGES, PAGED, is_photo, page_count
from posefit.footage.people import Choice
from posefit.footage.readers import (
    ARRAYS,
    Images,
    first_number,
    images_in,
    numbered_together,
    read_array,
    read_images,
    read_npy,
    read_npz,
    together,
)
from posefit.footage.scene import Scene, synthetic
from posefit.footage.segmentation import Segmentation
from posefit.footage.video import Video
from posefit.footage.views import Range, View
from posefit.geometry.body import Body
from posefit.geometry.calibration import Calibration, Up
from posefit.geometry.camera import Camera
from posefit.geometry.units import Unit
from posefit.motion import built_in, recorded
from posefit.motion.asf import Acclaim, parse_asf
from posefit.motion.clips import FPS, MOTIONS, FileOptions, Source, load_motion
from posefit.motion.motion import Motion
from posefit.progress import QUIET, Progress
from posefit.reading import cut, existing, quoted

# suffixes of other inputs: what ends in one of them is never tried as a video
NO_VIDEO = (*IMAGES, *MOTIONS, *ARRAYS, ".asf")


class _Unread(NamedTuple):
    """Suffixes that users may well try, but that posefit does not read."""

    suffixes: Sequence[str]
    what: str  # what such files hold
    instead: str  # what posefit reads instead


# without this table OpenCV would try these files, and call them damaged videos
UNREAD = (
    _Unread(
        suffixes=(
            *(".trc", ".c3d", ".fbx", ".glb", ".gltf", ".mvnx", ".mot", ".sto"),
            *(".osim", ".htr", ".v3d", ".vmd", ".usd", ".usda", ".usdc", ".usdz"),
            *(".bip", ".dae", ".blend", ".tsv"),
        ),
        what="motions",
        instead=" and ".join(MOTIONS),
    ),
    _Unread(
        suffixes=(
            *(".json", ".xml", ".csv", ".txt", ".yaml", ".yml", ".toml", ".zip"),
            *(".mat", ".h5", ".hdf5", ".pkl", ".pickle", ".pt", ".pth"),
        ),
        what="masks and motions",
        instead=f"masks as images or {' and '.join(ARRAYS)}, "
        f"and motions as {' and '.join(MOTIONS)}",
    ),
)
SIZE = (320, 240)  # width and height of rendered masks, by default
# what a source holds: a motion, masks, a video file, or pictures of a film
Medium = Literal["motion", "masks", "video", "pictures"]
# the same, as messages call it
_MEDIA: dict[Medium, str] = {
    "motion": "a motion",
    "masks": "masks",
    "video": "a video",
    "pictures": "pictures",
}
# what a user names for one camera: a motion or a file, masks (T, H, W), or image files
Footage = Source | NDArray[Any] | tuple[Path, ...]
# the same after `_place`: files are listed, and names of motions are known
Place = Motion | str | Path | Images | NDArray[Any]


class Kind(NamedTuple):
    """A kind of source and its reader: `view` for masks, `film` for pictures.

    A motion has neither; `load_motion` reads it.
    """

    medium: Medium
    recognises: Callable[[Place], bool]
    # (place, frames, label, fps) to the view
    view: Callable[[Any, Range, int | None, float | None], View] | None = None
    # (place, fps) to the film
    film: Callable[[Any, float | None], Video] | None = None


def _is_film(place: Place) -> bool:
    """Return whether images are a film: several pictures, the first in many colours."""
    if not isinstance(place, Images):
        return False
    first = place.files[0]
    return is_photo(first) and (len(place.files) > 1 or page_count(first) > 1)


def _is_video(place: Place) -> bool:
    """Return whether a file may be a video: any suffix that has no other meaning.

    Raises InputError for the suffixes in `UNREAD`.
    """
    if not isinstance(place, Path):
        return False
    suffix = place.suffix.lower()
    for unread in UNREAD:
        if suffix in unread.suffixes:
            raise InputError(
                f"{existing(place)}: {unread.what} of {suffix} are not read; "
                f"{unread.instead} are"
            )
    return suffix not in ("", *NO_VIDEO)


def _ends_in(suffix: str) -> Callable[[Place], bool]:
    return lambda place: isinstance(place, Path) and place.suffix.lower() == suffix


# the first kind that recognises a source reads it
KINDS = (
    Kind("masks", lambda place: isinstance(place, np.ndarray), view=read_array),
    Kind("masks", _ends_in(".npz"), view=read_npz),
    Kind("masks", _ends_in(".npy"), view=read_npy),
    Kind("pictures", _is_film, film=Video.of_pictures),
    Kind("masks", lambda place: isinstance(place, Images), view=read_images),
    Kind("video", _is_video, film=lambda place, _: Video.of(place)),
    Kind("motion", lambda _: True),  # names of motions need no suffix
)


@dataclass(frozen=True, eq=False)
class Resolved:
    """A source whose kind is known and whose files are found. Made by `resolve`."""

    medium: Medium
    named: Sequence[Footage]  # what the user named, one per camera
    names: Sequence[str]  # what messages call each
    places: Sequence[Place]  # where each is
    kinds: Sequence[Kind]  # what reads each


def resolve(source: Any) -> Resolved:
    """Recognise a source, or a sequence of them, and find its files.

    Args:
        source: As for `sources_of`. A resolved source is returned unchanged.

    Raises:
        InputError: No reader takes it, a file is missing, or cameras have sources of
            different kinds.

    """
    if isinstance(source, Resolved):
        return source
    named = sources_of(source)
    for each in named:
        # every output file states these names, so OpenCV's limits are checked first
        if isinstance(each, str | Path | tuple):
            opencv_name(each[0] if isinstance(each, tuple) else each)
    places = [_place(each) for each in named]
    kinds = [_kind_of(place) for place in places]
    media = {kind.medium for kind in kinds}
    if len(media) > 1:
        raise InputError(
            f"sources must be of one kind, got {' and '.join(sorted(media))}"
        )
    (medium,) = media
    if medium == "motion" and len(named) > 1:
        raise InputError(
            "source must be one motion, or views of one person, "
            f"got {len(named)} motions"
        )
    places = _with_numbers(places)
    names = [_name_of(place) for place in places]
    return Resolved(medium, named, names, places, kinds)


def _kind_of(place: Place) -> Kind:
    """Return the first kind that recognises a source. The last one takes anything."""
    return next(kind for kind in KINDS if kind.recognises(place))


def _with_numbers(places: Sequence[Place]) -> list[Place]:
    """Return places whose images are in the order of the numbers in their names.

    Cameras are paired by these numbers if all of them have images. If another camera
    has an .npz file, say, each camera's images are numbered alone.
    """
    images = [place for place in places if isinstance(place, Images)]
    if len(images) == len(places):
        return [*numbered_together(images)]
    numbered = list[Place]()
    for place in places:
        if isinstance(place, Images):
            (place,) = numbered_together([place])
        numbered.append(place)
    return numbered


def first_of(source: Resolved) -> int:
    """Return the number of the first frame that all cameras have.

    An .npz file of masks may state the number of its first frame. Other sources begin
    at 0.
    """
    first = 0
    for kind, place in zip(source.kinds, source.places, strict=True):
        if kind.view is read_npz:
            first = max(first, first_number(Path(str(place))))
    return first


def _place(source: Footage) -> Place:
    """Return where a source is.

    The name of a built-in motion is never taken for a folder. A path with a separator
    and without a suffix is a folder, even if it does not exist. Raises InputError for a
    path that cannot be a source.
    """
    if isinstance(source, np.ndarray | Motion):
        return source
    if isinstance(source, tuple):
        return _listed_images(source)
    if source in built_in.names() or recorded.is_recorded(source):
        return source
    path = Path(source)
    if path.is_dir():
        return _images_of_folder(path)
    if path.suffix:
        return path
    if path.is_file():
        raise InputError(
            f"{path}: expected a name that ends in what the file is, such as .mp4, "
            ".npz or .bvh, got no suffix"
        )
    return existing(path) if os.sep in str(source) else source


def _listed_images(files: tuple[Path, ...]) -> Images:
    """Return images that a user listed, named after their file or their folder."""
    if len(files) == 1:
        return Images(str(files[0]), files)
    folder = files[0].parent
    return Images(str(folder) if folder.name else "masks", files)


def _images_of_folder(folder: Path) -> Images:
    """Return the images in a folder. Raises InputError if it contains none."""
    if (folder / "poses.npz").is_file() and (folder / "summary.json").is_file():
        raise InputError(
            f"{folder}: expected a source, got a track's folder: give the source that "
            "it was made from"
        )
    images = images_in(folder)
    if not images:
        raise InputError(
            f"{folder}: expected a folder with mask images ({', '.join(IMAGES)}), "
            "got none"
        )
    return Images(str(folder), tuple(images))


def _name_of(place: Place) -> str:
    """Return what messages call a source."""
    if isinstance(place, Images | Motion):
        return place.name
    return "masks" if isinstance(place, np.ndarray) else str(place)


class _Use(NamedTuple):
    """The sources that an option applies to."""

    where: str  # as messages call them
    media: Sequence[Medium]


_FOOTAGE: Sequence[Medium] = ("masks", "video", "pictures")
_USED_FOR = {
    "extraction": _Use("video", ["video", "pictures"]),
    "fps": _Use("motions, masks and pictures", ["motion", "masks", "pictures"]),
    "label": _Use("masks", ["masks"]),
    "holes": _Use("masks", ["masks"]),
    "height": _Use("footage", _FOOTAGE),
    "person": _Use("footage", _FOOTAGE),
    "size": _Use("motions", ["motion"]),
}


def check_used(medium: Medium, view: Mapping[str, Any]) -> None:
    """Raise InputError if a given option does not apply to this kind of source.

    Args:
        medium: The kind of source.
        view: The options by name; None if not given.

    """
    for name, use in _USED_FOR.items():
        if medium not in use.media and view.get(name) is not None:
            raise useless_for(medium, name, view[name], use.where)
    if medium == "motion" or view.get("camera"):
        return
    # without these files nothing is left that has an axis or a unit
    files = "calibrations and files of motions"
    if view.get("up") is not None:
        raise useless_for(medium, "up", view["up"], files)
    if view.get("unit") is not None and view.get("asf") is None:
        raise useless_for(medium, "unit", view["unit"], files)


def useless_for(medium: Medium, name: str, value: object, where: str) -> InputError:
    """Return the error for an option that does not apply to this kind of source.

    `where` says which sources the option is for.
    """
    return InputError(
        f"{name} must be given for {where} only, got {quoted(value)} "
        f"for {_MEDIA[medium]}"
    )


def scene_of(
    source: Any,
    progress: Progress = QUIET,
    *,
    asf: str | Path | None = None,
    camera: Sequence[Camera | Calibration | str | Path] = (),
    view_degrees: Sequence[float] = (),
    size: tuple[int, int] | None = None,
    fps: float | None = None,
    frames: Range = (None, None),
    extraction: Extraction | None = None,
    height: float | None = None,
    up: Up | None = None,
    unit: Unit | None = None,
    rate: float | None = None,
    label: int | None = None,
    holes: float | None = None,
    person: Choice | None = None,
) -> Scene:
    """Return the scene of a motion, or of what cameras saw at the same times.

    Several segmenters may be tried on a film. The first one without doubtful masks is
    used, or else the one with the least doubtful masks.

    Args:
        source: As for `resolve`, or its result.
        progress: Shows how far reading is.
        asf: Skeleton file of the person.
        camera: Cameras, calibrations, or their files; by default one is guessed.
        view_degrees: Angles of the cameras around a motion, or which way the person
            faces in footage.
        size: Width and height of rendered masks.
        fps: Frames per second; by default what the source states, or else 30.
        frames: First frame, and the frame after the last.
        extraction: How the person is segmented in a film.
        height: Height of the person in metres.
        up: Which axis of the calibrations or the motion's file points up.
        unit: Unit of the calibrations or the motion's file.
        rate: Frames per second of a motion's file that does not state them.
        label: The person's value in masks with several labels.
        holes: Share of the person's area up to which holes are filled.
        person: Which of several people is followed.

    Returns:
        The scene, whose guesses are logged.

    Raises:
        InputError: An option does not fit the source, or no segmenter finds a person.

    """
    source = resolve(source)
    if source.medium == "motion":
        # `up` and `unit` describe the calibrations if given, or else the motion's file
        cameras, guesses = _placed(listed(camera), size or SIZE, up, unit)
        stated = FileOptions(
            asf, None if cameras else unit, None if cameras else up, rate
        )
        motion = load_motion(cast(Source, source.places[0]), fps or FPS, stated)
        scene = synthetic(motion, view_degrees, size or SIZE, cameras, frames, guesses)
        return logged(scene, progress)
    if len(view_degrees) > 1:
        raise InputError(
            "view_degrees must be one for footage, of its first camera, "
            f"got {len(view_degrees)}"
        )
    body, notes, of_height = body_of(asf, height, None if camera else unit)
    facing = view_degrees[0] if view_degrees else None
    films = films_of(source, fps)
    sizes = [film.size for film in films]
    known = calibrated(camera, sizes or [None] * len(source.places), source.names)

    def combine(views: Sequence[View]) -> Scene:
        name = Path(views[0].name).stem
        return combined(views, name, body, known, facing, up, fps, unit)

    if films:
        how = replace(extraction or Extraction(), person=person)
        result = _of_films(films, known, how, frames, progress, combine)
    else:
        views = views_of_masks(source, frames, label, fps)
        result = combine(_of_one_person(views, known, holes, person))
    result = replace(
        result,
        warnings=[*notes, *result.warnings],
        guesses=[*result.guesses, *of_height],
    )
    return logged(result, progress)


def _placed(
    known: Sequence[Camera | Calibration],
    size: tuple[int, int],
    up: Up | None,
    unit: Unit | None,
) -> tuple[list[Camera], list[str]]:
    """Return the cameras around a known motion, and what was guessed about them.

    `size` is used for calibrations that do not state theirs.
    """
    world, metres, guesses = world_of(known, up, unit)
    cameras = list[Camera]()
    for each in known:
        if isinstance(each, Calibration):
            each = each.in_metres(metres).camera(each.size or size, world)
        # the rasteriser needs square pixels
        cameras.append(each.squared())
    return cameras, [*guesses.values()]


def logged(scene: Scene, progress: Progress) -> Scene:
    """Log the guesses of a scene, and return it."""
    if scene.guesses:
        progress.log(f"guessed: {'; '.join(scene.guesses)}")
    return scene


def films_of(source: Resolved, fps: float | None = None) -> list[Video]:
    """Return the films of a source, one per camera; an empty list if it has masks.

    `fps` is the rate of pictures. Raises InputError if a film cannot be read, or if the
    rates differ.
    """
    films = list[Video]()
    for kind, place in zip(source.kinds, source.places, strict=True):
        if kind.film is not None:
            films.append(kind.film(place, fps))
    # videos that were cut or converted state rates that differ after the third decimal
    rates = sorted({round(film.fps, 3) for film in films})
    if len(rates) > 1:
        came = ", ".join(str(rate) for rate in rates)
        raise InputError(f"videos must have one frame rate, got {came}")
    return films


def views_of_masks(
    source: Resolved,
    frames: Range = (None, None),
    label: int | None = None,
    fps: float | None = None,
) -> list[View]:
    """Return the views of a source of masks, one per camera, of the same frames.

    Args:
        source: Masks; other sources have no views yet.
        frames: Which frames to read.
        label: The person's value, for masks with several labels.
        fps: Frames per second; by default what the source states.

    Raises:
        InputError: Masks cannot be read, or cameras have no frame in common.

    """
    views = list[View]()
    for kind, place in zip(source.kinds, source.places, strict=True):
        if kind.view is not None:
            views.append(kind.view(place, frames, label, fps))
    return together(views)


def _of_one_person(
    views: Sequence[View],
    known: Sequence[Camera | Calibration],
    holes: float | None,
    person: Choice | None,
) -> list[View]:
    """Return cleaned views of one person: the one that the first view follows."""
    clean = [cleaned(views[0], holes, person)]
    for k, view in enumerate(views[1:], 1):
        choose = partial(same_person, [known[0], known[k]], clean[0], view.size)
        clean.append(cleaned(view, holes, choose))
    return clean


class _Attempt(NamedTuple):
    """What one segmenter made of the films."""

    name: str  # of the segmenter
    scene: Scene | None  # None if it found no person
    doubt: str  # what is wrong with its masks; "" if nothing


def _of_films(
    films: Sequence[Video],
    known: Sequence[Camera | Calibration],
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
            views = _taken_out(parts, known, progress)
            doubts = [view.doubt for view in views if view.doubt]
            attempt = _Attempt(way.name, combine(views), doubts[0] if doubts else "")
        except NoPersonError as error:
            attempt = _Attempt(way.name, None, str(error))
        attempts.append(attempt)
        if not attempt.doubt:
            break
    # doubtful masks are better than none, and of equals the first segmenter's
    best = min(attempts, key=lambda each: (each.scene is None, bool(each.doubt)))
    if best.scene is None:
        raise NoPersonError(best.doubt)
    first = attempts[0]
    if best is first:
        return best.scene
    reason, _, _ = first.doubt.partition(";")
    warning = f"segmented by {best.name} instead of {first.name}: {reason}"
    return replace(best.scene, warnings=[*best.scene.warnings, warning])


def _taken_out(
    parts: list[Segmentation],
    known: Sequence[Camera | Calibration],
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
                [known[0], known[k]],
                views[0],
                part.size,
                filmed=part.video.size,
            )
        view, _, doubt = part.read(progress.steps, choose)
        if doubt is not None and doubt.refused:
            raise NoPersonError(doubt.text)
        # a track shows the pictures of the first camera only
        views.append(replace(view, pictures=None) if views else view)
    return views


def body_of(
    asf: str | Path | None, height: float | None, unit: Unit | None = None
) -> tuple[Body, Sequence[str], Sequence[str]]:
    """Return the person's body, with warnings and guesses about it.

    Args:
        asf: A skeleton file; None for the average skeleton.
        height: Height in metres that the body is scaled to.
        unit: Unit of the skeleton file.

    Returns:
        The body, warnings about the file, and what was guessed. A given height replaces
        what both of them are about.

    """
    average = Acclaim(built_in.average_skeleton(), 1.0)
    acclaim = average if asf is None else parse_asf(asf, unit)
    body = Body.of(acclaim.skeleton)
    if height is not None:
        factor = height / body.stature
        return body.scaled(factor, factor), (), ()
    guesses = [f"a person of {body.stature:.2f} m"] if asf is None else []
    return body, acclaim.notes, guesses


def sources_of(source: Any) -> list[Footage]:
    """Return one source per camera.

    Args:
        source: One source, or a sequence. Images and masks (H, W) in a sequence are the
            frames of one camera. Anything else in a sequence, such as a video or a
            sequence of images, is one camera each.

    Raises:
        InputError: The source is none of these.

    """
    if isinstance(source, os.PathLike):
        source = Path(source)
    if _is_named(source):
        return [_images(source) if _is_image(source) else source]
    if _is_array(source):
        array = _array(source)
        # an array of texts is a list of them
        if array.dtype.kind in "OU":
            return sources_of(array.tolist())
        return [array[None] if array.ndim == 2 else array]
    if not isinstance(source, Sequence) or isinstance(source, bytes):
        raise InputError(
            "source must be a motion, masks, a video or a list of these, "
            f"got {quoted(source)}"
        )
    if not source:
        raise InputError("source must name something, got an empty list")
    frames = _frames(source)
    return [_view(each) for each in source] if frames is None else [frames]


def _view(source: Any) -> Footage:
    """Return the source of one of several cameras."""
    if not isinstance(source, Sequence) or isinstance(source, str | Motion):
        (view,) = sources_of(source)
        return view
    frames = _frames(source) if source else None
    if frames is None:
        raise InputError(
            "source must have image files or masks in the list of each camera, "
            f"got {quoted(source)}"
        )
    return frames


def _frames(sources: Sequence[Any]) -> NDArray[Any] | tuple[Path, ...] | None:
    """Return the frames of one camera; None if they are not images or masks (H, W)."""
    if all(_is_image(each) for each in sources):
        files = _images(*sources)
        return None if _are_films(files) else files
    if not all(_is_array(each) for each in sources):
        return None
    masks = [_array(each) for each in sources]
    if any(mask.ndim != 2 for mask in masks):
        return None
    shapes = sorted({str(mask.shape) for mask in masks})
    if len(shapes) > 1:
        raise InputError(f"masks must have one shape, got {', '.join(shapes)}")
    return np.stack(masks)


def _are_films(files: Sequence[Path]) -> bool:
    """Return whether each of several image files is a film: a file of several pages.

    Raises InputError if only some of them have several pages.
    """
    if len(files) == 1:
        return False
    pages = list[int]()
    for file in files:
        is_paged = file.suffix.lower() in PAGED and file.is_file()
        pages.append(page_count(file) if is_paged else 1)
    if max(pages) == 1:
        return False
    if min(pages) == 1:
        raise InputError(
            "source must be images of one page each, or a file of several pages for "
            f"each camera, got {files[pages.index(1)]} with only one page"
        )
    return True


def _is_named(source: Any) -> bool:
    return isinstance(source, str | os.PathLike | Motion)


def _is_image(source: Any) -> bool:
    """Return whether a source is the path of an image file, by its suffix."""
    if not isinstance(source, str | os.PathLike):
        return False
    path = Path(source)
    return path.suffix.lower() in IMAGES and not path.is_dir()


def _images(*files: str | os.PathLike[str]) -> tuple[Path, ...]:
    return tuple(Path(file) for file in files)


def _is_array(source: Any) -> bool:
    return not _is_named(source) and hasattr(source, "__array__")


def _array(source: Any) -> Any:
    """Convert another library's array to NumPy.

    Raises InputError if NumPy cannot read it, for example an array on a GPU.
    """
    try:
        return np.asarray(source)
    except Exception as error:
        raise InputError(
            f"masks must be arrays that NumPy can read, got {type(source).__name__}: "
            f"{cut(str(error))}"
        ) from None
