"""What a user names, a motion or what one camera or several saw, becomes a scene, once.

    from posefit.footage.source import resolve, scene_of

    source = resolve(["a.mp4", "b.mp4"])     # of which kind it is, and the files of each camera
    scene = scene_of(source, camera=["cameras.toml"])

A kind of source is a line of `KINDS`: how it is recognised, and the reader, which returns a `View` or a film of which a
segmenter makes one.
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
from posefit.footage.segmentation import Extraction, Segmentation
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

NO_VIDEO = (*IMAGES, *MOTIONS, *ARRAYS, ".asf")
# files that a user may well name, what they hold, and what is read of that
UNREAD = (
    (
        (
            *(".trc", ".c3d", ".fbx", ".glb", ".gltf", ".mvnx", ".mot", ".sto"),
            *(".osim", ".htr", ".v3d", ".vmd", ".usd", ".usda", ".usdc", ".usdz"),
            *(".bip", ".dae", ".blend", ".tsv"),
        ),
        "motions",
        " and ".join(MOTIONS),
    ),
    (
        (
            *(".json", ".xml", ".csv", ".txt", ".yaml", ".yml", ".toml", ".zip"),
            *(".mat", ".h5", ".hdf5", ".pkl", ".pickle", ".pt", ".pth"),
        ),
        "masks and motions",
        f"masks as images or {' and '.join(ARRAYS)}, and motions as {' and '.join(MOTIONS)}",
    ),
)
SIZE = (320, 240)  # pixels of a rendered picture
# what a source is of: a motion, masks, a video file, or pictures of a film
Medium = Literal["motion", "masks", "video", "pictures"]
_MEDIA: dict[Medium, str] = {
    "motion": "a motion",
    "masks": "masks",
    "video": "a video",
    "pictures": "pictures",
}
# what a user names of one camera: image files, or masks (T, H, W), or one file
Footage = Source | NDArray[Any] | tuple[Path, ...]
# the same, once it is known to be there
Place = Motion | str | Path | Images | NDArray[Any]


class Kind(NamedTuple):
    """A kind of source, which one reader reads: a function that returns a view, or a film; none reads a motion."""

    medium: Medium
    recognises: Callable[[Place], bool]
    # of a place, frames, a label, and a rate
    view: Callable[[Any, Range, int | None, float | None], View] | None = None
    # of a place, and a rate
    film: Callable[[Any, float | None], Video] | None = None


def _is_film(place: Place) -> bool:
    """Return whether images are a film: there are several, or pages, and the first is a picture in many colours."""
    return (
        isinstance(place, Images)
        and is_photo(place.files[0])
        and (len(place.files) > 1 or page_count(place.files[0]) > 1)
    )


def _is_video(place: Place) -> bool:
    """Return whether a file is a video: what is no other file is. Raises InputError for one that is known not to be."""
    if not isinstance(place, Path):
        return False
    suffix = place.suffix.lower()
    for suffixes, what, instead in UNREAD:
        if suffix in suffixes:
            raise InputError(
                f"{existing(place)}: {what} of {suffix} are not read; {instead} are"
            )
    return suffix not in ("", *NO_VIDEO)


def _ends_in(suffix: str) -> Callable[[Place], bool]:
    return lambda place: isinstance(place, Path) and place.suffix.lower() == suffix


# the first that recognises a source reads it
KINDS = (
    Kind("masks", lambda place: isinstance(place, np.ndarray), view=read_array),
    Kind("masks", _ends_in(".npz"), view=read_npz),
    Kind("masks", _ends_in(".npy"), view=read_npy),
    Kind("pictures", _is_film, film=Video.of_pictures),
    Kind("masks", lambda place: isinstance(place, Images), view=read_images),
    Kind("video", _is_video, film=lambda place, _: Video.of(place)),
    Kind("motion", lambda _: True),  # whose names need no suffix
)


@dataclass(frozen=True, eq=False)
class Resolved:
    """What a user named, of which kind it is, and where: found out once."""

    medium: Medium
    named: Sequence[Footage]  # of each camera
    names: Sequence[str]  # what messages call them
    places: Sequence[Place]
    kinds: Sequence[Kind]


def resolve(source: Any) -> Resolved:
    """Return what a user names: a source, or a sequence of them, as `sources_of` takes them.

    Raises InputError where it is nothing that is read, or of several kinds.
    """
    if isinstance(source, Resolved):
        return source
    named = sources_of(source)
    for each in named:  # names are in every file that is written
        if isinstance(each, str | Path | tuple):
            opencv_name(each[0] if isinstance(each, tuple) else each)
    places = list(map(_place, named))
    kinds = [next(kind for kind in KINDS if kind.recognises(each)) for each in places]
    media = {kind.medium for kind in kinds}
    if len(media) > 1:
        raise InputError(
            f"sources must be of one kind, got {' and '.join(sorted(media))}"
        )
    (medium,) = media
    if medium == "motion" and len(named) > 1:
        raise InputError(
            f"source must be one motion, or views of one person, got {len(named)} motions"
        )
    images = [place for place in places if isinstance(place, Images)]
    if len(images) == len(places):
        places = [*numbered_together(images)]
    else:
        places = [
            numbered_together([place])[0] if isinstance(place, Images) else place
            for place in places
        ]
    return Resolved(medium, named, [*map(_name_of, places)], places, kinds)


def first_of(source: Resolved) -> int:
    """Return the number of the first frame that all cameras have.

    An .npz file of masks may state its own; other sources begin at 0.
    """
    archives = [
        place
        for kind, place in zip(source.kinds, source.places, strict=True)
        if kind.view is read_npz
    ]
    return max((first_number(Path(str(place))) for place in archives), default=0)


def _place(source: Footage) -> Place:
    """Return where a source is: a built-in motion's name is never a folder.

    A path with a separator and no suffix is a folder, even if it does not exist. Raises InputError for a file whose
    name says that it is no source.
    """
    if isinstance(source, np.ndarray | Motion):
        return source
    if isinstance(source, tuple):
        folder = source[0].parent
        name = str(source[0]) if len(source) == 1 else str(folder)
        return Images(name if folder.name or len(source) == 1 else "masks", source)
    if source in built_in.names() or recorded.is_recorded(source):
        return source
    path = Path(source)
    suffix = path.suffix.lower()
    if path.is_dir():
        if (path / "poses.npz").is_file() and (path / "summary.json").is_file():
            raise InputError(
                f"{path}: expected a source, got a track's folder: give the source that it was made from"
            )
        images = images_in(path)
        if not images:
            raise InputError(
                f"{path}: expected a folder with mask images ({', '.join(IMAGES)}), got none"
            )
        return Images(str(path), tuple(images))
    if not suffix and path.is_file():
        raise InputError(
            f"{path}: expected a name that ends in what the file is, such as .mp4, .npz or .bvh, got no suffix"
        )
    if not suffix:
        return existing(path) if os.sep in str(source) else source
    return path


def _name_of(place: Place) -> str:
    if isinstance(place, Images | Motion):
        return place.name
    return "masks" if isinstance(place, np.ndarray) else str(place)


_USED_FOR: dict[str, tuple[str, Sequence[Medium]]] = {
    "extraction": ("video", ["video", "pictures"]),
    "fps": ("motions, masks and pictures", ["motion", "masks", "pictures"]),
    "label": ("masks", ["masks"]),
    "holes": ("masks", ["masks"]),
    "height": ("footage", ["masks", "video", "pictures"]),
    "person": ("footage", ["masks", "video", "pictures"]),
    "size": ("motions", ["motion"]),
}


def check_used(medium: Medium, view: Mapping[str, Any]) -> None:
    """Raise InputError where an option is given that sources of this kind have no use for."""
    for name, (where, media) in _USED_FOR.items():
        if medium not in media and view.get(name) is not None:
            raise useless_for(medium, name, view[name], where)
    if view.get("up") is not None and not view.get("camera") and medium != "motion":
        raise useless_for(medium, "up", view["up"], "calibrations and files of motions")
    if (
        view.get("unit") is not None
        and medium != "motion"
        and view.get("asf") is None
        and not view.get("camera")
    ):
        raise useless_for(
            medium, "unit", view["unit"], "calibrations and files of motions"
        )


def useless_for(medium: Medium, name: str, value: object, where: str) -> InputError:
    """Return the error of an option that sources of this kind have no use for, and says for which it is given."""
    return InputError(
        f"{name} must be given for {where} only, got {quoted(value)} for {_MEDIA[medium]}"
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
    """Return the scene of what `resolve` returns or takes: a motion, or what cameras saw at the same times.

    The options are those of `posefit.track`, see `posefit.tracking.options`; `check_used` refuses those that
    sources have no use for. Of several ways to take the person out of a film, the first is used whose masks are not
    doubted, or else are doubted least. Raises InputError where an option does not fit, or no way shows a person.
    """
    source = resolve(source)
    if source.medium == "motion":
        # `up` and `unit` are those of the calibrations, where there are any, and else of the motion's file
        cameras, guesses = _placed(listed(camera), size or SIZE, up, unit)
        stated = FileOptions(
            asf, None if cameras else unit, None if cameras else up, rate
        )
        motion = load_motion(cast(Source, source.places[0]), fps or FPS, stated)
        return logged(
            synthetic(motion, view_degrees, size or SIZE, cameras, frames, guesses),
            progress,
        )
    if len(view_degrees) > 1:
        raise InputError(
            f"view_degrees must be one for footage, of its first camera, got {len(view_degrees)}"
        )
    body, notes, of_height = body_of(asf, height, None if camera else unit)
    facing = view_degrees[0] if view_degrees else None
    films = films_of(source, fps)
    sizes = [film.size for film in films]
    known = calibrated(camera, sizes or [None] * len(source.places), source.names)

    def scene(views: Sequence[View]) -> Scene:
        return combined(
            views, Path(views[0].name).stem, body, known, facing, up, fps, unit
        )

    if films:
        how = replace(extraction or Extraction(), person=person)
        result = _of_films(films, known, how, frames, progress, scene)
    else:
        views = views_of_masks(source, frames, label, fps)
        result = scene(_of_one_person(views, known, holes, person))
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
    """Return the cameras around a known motion, of a `size` where a file states none, and what was guessed of them."""
    world, metres, guesses = world_of(known, up, unit)
    cameras = [
        camera
        if isinstance(camera, Camera)
        else camera.in_metres(metres).camera(camera.size or size, world)
        for camera in known
    ]
    # bodies are drawn with square pixels
    return [camera.squared() for camera in cameras], [*guesses.values()]


def logged(scene: Scene, progress: Progress) -> Scene:
    """Return a scene whose guesses are logged."""
    if scene.guesses:
        progress.log(f"guessed: {'; '.join(scene.guesses)}")
    return scene


def films_of(source: Resolved, fps: float | None = None) -> list[Video]:
    """Return the films that cameras took, pictures at a rate; none where a source is of masks.

    Raises InputError where one cannot be read, or their rates differ.
    """
    read = zip(source.kinds, source.places, strict=True)
    films = [kind.film(place, fps) for kind, place in read if kind.film is not None]
    rates = {round(film.fps, 3) for film in films}
    if len(rates) > 1:
        raise InputError(
            f"videos must have one frame rate, got {', '.join(map(str, sorted(rates)))}"
        )
    return films


def views_of_masks(
    source: Resolved,
    frames: Range = (None, None),
    label: int | None = None,
    fps: float | None = None,
) -> list[View]:
    """Return what cameras saw, as masks show it. `label` is the person's value, where masks hold several.

    Raises InputError naming the file where masks cannot be read, or cameras have no frame in common.
    """
    read = zip(source.kinds, source.places, strict=True)
    return together(
        [
            kind.view(place, frames, label, fps)
            for kind, place in read
            if kind.view is not None
        ]
    )


def _of_one_person(
    views: Sequence[View],
    known: Sequence[Camera | Calibration],
    holes: float | None,
    person: Choice | None,
) -> list[View]:
    """Return views of the person who is followed in the first one."""
    clean = [cleaned(views[0], holes, person)]
    for k, view in enumerate(views[1:], 1):
        choose = partial(same_person, [known[0], known[k]], clean[0], view.size)
        clean.append(cleaned(view, holes, choose))
    return clean


def _of_films(
    films: Sequence[Video],
    known: Sequence[Camera | Calibration],
    how: Extraction,
    frames: Range,
    progress: Progress,
    scene: Callable[[Sequence[View]], Scene],
) -> Scene:
    """Return the scene of what films show. Raises NoPersonError where no way shows a person."""
    tried = list[tuple[str, Scene | None, str]]()
    for way in how.ways(len(films)):
        among = how if len(films) == 1 and way is not how else None
        # all are checked before any is read
        parts = [Segmentation(film, way, frames, among) for film in films]
        try:
            views = _taken_out(parts, known, progress)
            doubts = [view.doubt for view in views if view.doubt]
            tried.append((way.name, scene(views), doubts[0] if doubts else ""))
        except NoPersonError as error:
            tried.append((way.name, None, str(error)))
        if not tried[-1][2]:
            break
    name, result, doubt = min(
        tried, key=lambda way: 2 if way[1] is None else bool(way[2])
    )
    if result is None:
        raise NoPersonError(doubt)
    first, _, before = tried[0]
    if name != first:
        warning = f"{name} took the person out, instead of {first}: {before.partition(';')[0]}"
        result = replace(result, warnings=[*result.warnings, warning])
    return result


def _taken_out(
    parts: Sequence[Segmentation],
    known: Sequence[Camera | Calibration],
    progress: Progress,
) -> list[View]:
    """Return views of the person who is followed in the first film. Raises NoPersonError for masks that are refused."""
    views = list[View]()
    for k, part in enumerate(parts):
        progress.log(f"taking the person out of {part.video.path} by {part.how.name}")
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
        views.append(view)
    return views


def body_of(
    asf: str | Path | None, height: float | None, unit: Unit | None = None
) -> tuple[Body, Sequence[str], Sequence[str]]:
    """Return the body of a skeleton file, or the average one, scaled to a height in metres; warnings, and guesses."""
    acclaim = (
        Acclaim(built_in.average_skeleton(), 1.0)
        if asf is None
        else parse_asf(asf, unit)
    )
    body = Body.of(acclaim.skeleton)
    if height is not None:
        return body.scaled(height / body.stature, height / body.stature), (), ()
    return (
        body,
        acclaim.notes,
        [f"a person of {body.stature:.2f} m"] if asf is None else (),
    )


def sources_of(source: Any) -> list[Footage]:
    """Return one source a camera of what a user names: a source, or a sequence of them.

    Images and masks (H, W) in a sequence are the frames of one camera; sequences of these in a sequence, and anything
    else in one, are of a camera each. Raises InputError where it is anything else.
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
            f"source must be a motion, masks, a video or a list of these, got {quoted(source)}"
        )
    if not source:
        raise InputError("source must name something, got an empty list")
    frames = _frames(source)
    return [_view(each) for each in source] if frames is None else [frames]


def _view(source: Any) -> Footage:
    """Return what one of several cameras took."""
    if not isinstance(source, Sequence) or isinstance(source, str | Motion):
        (view,) = sources_of(source)
        return view
    frames = _frames(source) if source else None
    if frames is None:
        raise InputError(
            f"source must have image files or masks in the list of each camera, got {quoted(source)}"
        )
    return frames


def _frames(sources: Sequence[Any]) -> NDArray[Any] | tuple[Path, ...] | None:
    """Return the frames of one camera, image files or masks (H, W); None where these are anything else."""
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
    """Return whether image files are what several cameras took: several of them, each with several pages."""
    if len(files) == 1:
        return False
    pages = [
        page_count(file) if file.suffix.lower() in PAGED and file.is_file() else 1
        for file in files
    ]
    if max(pages) == 1:
        return False
    if min(pages) == 1:
        raise InputError(
            "source must be images of one page each, or a file of several pages for "
            f"each camera, got {files[pages.index(1)]} beside such a file"
        )
    return True


def _is_named(source: Any) -> bool:
    return isinstance(source, str | os.PathLike | Motion)


def _is_image(source: Any) -> bool:
    return (
        isinstance(source, str | os.PathLike)
        and Path(source).suffix.lower() in IMAGES
        and not Path(source).is_dir()
    )


def _images(*files: str | os.PathLike[str]) -> tuple[Path, ...]:
    return tuple(Path(file) for file in files)


def _is_array(source: Any) -> bool:
    return not _is_named(source) and hasattr(source, "__array__")


def _array(source: Any) -> Any:
    """Return a NumPy array of another library's. Raises InputError where that has none, as on a GPU."""
    try:
        return np.asarray(source)
    except Exception as error:
        raise InputError(
            f"masks must be arrays that NumPy can read, got {type(source).__name__}: {cut(str(error))}"
        ) from None
