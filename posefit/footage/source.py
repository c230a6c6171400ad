"""What a user names, a motion or what one camera or several saw, becomes a scene, once."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from posefit.errors import InputError
from posefit.files import opencv_name
from posefit.footage.cameras import (
    CameraView,
    calibrated,
    combined,
    listed,
    same_person,
    world_of,
)
from posefit.footage.cleaning import cleaned
from posefit.footage.images import IMAGES, is_photo, page_count
from posefit.footage.masks import ARRAYS, Range
from posefit.footage.people import Choice
from posefit.footage.quality import Verdict
from posefit.footage.readers import (
    Masks,
    images_in,
    images_of,
    name_of,
    numbered,
    numbered_together,
    read_views,
)
from posefit.footage.scene import Scene, synthetic
from posefit.footage.segmentation import Extraction, Segmentation
from posefit.footage.video import Video
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

PAGED = (".tif", ".tiff", ".gif", ".webp")  # images that may have several pages
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
Kind = Literal["motion", "masks", "video", "pictures"]
_KINDS: dict[Kind, str] = {
    "motion": "a motion",
    "masks": "masks",
    "video": "a video",
    "pictures": "pictures",
}
Footage = Source | Masks
_USED_FOR: dict[str, tuple[str, Sequence[Kind]]] = {
    "extraction": ("video", ["video", "pictures"]),
    "fps": ("motions, masks and pictures", ["motion", "masks", "pictures"]),
    "label": ("masks", ["masks"]),
    "holes": ("masks", ["masks"]),
    "height": ("footage", ["masks", "video", "pictures"]),
    "person": ("footage", ["masks", "video", "pictures"]),
    "size": ("motions", ["motion"]),
}


def check_used(kind: Kind, view: Mapping[str, Any]) -> None:
    """Raise InputError where an option is given that sources of this kind have no use for."""
    for name, (where, kinds) in _USED_FOR.items():
        if kind not in kinds and view.get(name) is not None:
            raise useless_for(kind, name, view[name], where)
    if view.get("up") is not None and not view.get("camera") and kind != "motion":
        raise useless_for(kind, "up", view["up"], "calibrations and files of motions")
    if (
        view.get("unit") is not None
        and kind != "motion"
        and view.get("asf") is None
        and not view.get("camera")
    ):
        raise useless_for(
            kind, "unit", view["unit"], "calibrations and files of motions"
        )


def useless_for(kind: Kind, name: str, value: object, where: str) -> InputError:
    """Return the error of an option that sources of this kind have no use for, and says for which it is given."""
    return InputError(
        f"{name} must be given for {where} only, got {quoted(value)} for {_KINDS[kind]}"
    )


def scene_of(
    sources: Sequence[Footage],
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
    """Return the scene of a source, or of what several cameras saw at the same times.

    The options are those of `posefit.track`, see `posefit.tracking.options`; `check_used` refuses those that
    sources have no use for. Raises InputError where one does not fit.
    """
    for source in sources:  # names are in every file that is written
        if isinstance(source, str | Path | tuple):
            opencv_name(source[0] if isinstance(source, tuple) else source)
    kinds = {kind_of(source) for source in sources}
    if len(kinds) > 1:
        raise InputError(
            f"sources must be of one kind, got {' and '.join(sorted(kinds))}"
        )
    (kind,) = kinds
    if kind == "motion":
        if len(sources) > 1:
            raise InputError(
                f"source must be one motion, or views of one person, got {len(sources)} motions"
            )
        # `up` and `unit` are those of the calibrations, where there are any, and else of the motion's file
        cameras, guesses = _placed(listed(camera), size or SIZE, up, unit)
        stated = FileOptions(
            asf, None if cameras else unit, None if cameras else up, rate
        )
        motion = load_motion(cast(Source, sources[0]), fps or FPS, stated)
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

    def scene(views: Sequence[CameraView]) -> Scene:
        return combined(
            views, Path(views[0].name).stem, body, known, facing, up, fps, unit
        )

    if kind in ("video", "pictures"):
        videos = films_of(cast(Sequence[str | Path | tuple[Path, ...]], sources), fps)
        rates = {round(video.fps, 3) for video in videos}
        if len(rates) > 1:
            raise InputError(
                f"videos must have one frame rate, got {', '.join(map(str, sorted(rates)))}"
            )
        known = calibrated(
            camera,
            [video.size for video in videos],
            [str(video.path) for video in videos],
        )
        how = replace(extraction or Extraction(), person=person)
        result = _filmed(videos, known, how, frames, progress, scene)
    else:
        places = [
            source if isinstance(source, np.ndarray | tuple) else Path(str(source))
            for source in sources
        ]
        known = calibrated(
            camera, [None] * len(places), [name_of(place) for place in places]
        )
        views = list[CameraView]()
        read = read_views(places, frames, label)
        for place, masks in zip(places, read, strict=True):
            choice = (
                partial(
                    same_person, [known[0], known[len(views)]], views[0], masks.size
                )
                if views
                else person
            )
            views.append(
                CameraView(
                    *cleaned(masks, name_of(place), holes, choice), name=name_of(place)
                )
            )
        result = scene(views)
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


def films_of(
    sources: Sequence[str | Path | tuple[Path, ...]], fps: float | None
) -> list[Video]:
    """Return the films that cameras took: video files, or folders and lists of pictures, taken at a rate.

    Pictures of one moment are those of one number. Raises InputError where a film cannot be read, or pictures have no
    number in common.
    """
    places = [
        source if isinstance(source, tuple) else Path(source) for source in sources
    ]
    pictures = [view for place in places if (view := images_of(place)) is not None]
    if len(pictures) < len(places):
        return [_film(place, fps) for place in places]
    names = [name_of(place) for place in places]
    views = numbered_together(pictures, names)
    return [
        Video.of_pictures(view, Path(name), fps)
        for view, name in zip(views, names, strict=True)
    ]


def _film(place: Path | tuple[Path, ...], fps: float | None) -> Video:
    pictures = images_of(place)
    if pictures is None:
        assert isinstance(place, Path)
        return Video.of(place)
    name = name_of(place)
    return Video.of_pictures(numbered(pictures, name), Path(name), fps)


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


def _filmed(
    videos: Sequence[Video],
    known: Sequence[Camera | Calibration],
    how: Extraction,
    frames: Range,
    progress: Progress,
    scene: Callable[[Sequence[CameraView]], Scene],
) -> Scene:
    """Return the scene of what videos show. Raises InputError where their masks cannot be those of a person.

    Of several ways to take the person out, the first is used whose masks are not doubted, or else are doubted least.
    """
    tried = list[tuple[str, Scene | None, Verdict | None]]()
    for way in how.ways(len(videos)):
        among = how if len(videos) == 1 and way is not how else None
        # all are checked before any is read
        parts = [Segmentation(video, way, frames, among) for video in videos]
        tried.append((way.name, *_taken_out(parts, known, progress, scene)))
        if tried[-1][2] is None:
            break
    name, result, doubt = min(
        tried, key=lambda way: 0 if way[2] is None else 1 + way[2].refused
    )
    if result is None:
        assert doubt is not None
        raise InputError(doubt.text)
    first, _, before = tried[0]
    if name != first and before is not None:
        warning = f"{name} took the person out, instead of {first}: {before.text.partition(';')[0]}"
        result = replace(result, warnings=[*result.warnings, warning])
    return result


def _taken_out(
    parts: Sequence[Segmentation],
    known: Sequence[Camera | Calibration],
    progress: Progress,
    scene: Callable[[Sequence[CameraView]], Scene],
) -> tuple[Scene | None, Verdict | None]:
    """Return the scene of what videos show, and the worst that is wrong with their masks; no scene of refused ones."""
    views = list[CameraView]()
    worst = None
    try:
        for part in parts:
            progress.log(
                f"taking the person out of {part.video.path} by {part.how.name}"
            )
            choose = (
                partial(
                    same_person,
                    [known[0], known[len(views)]],
                    views[0],
                    part.size,
                    filmed=part.video.size,
                )
                if views
                else None
            )
            masks, _, doubt, warnings, facings, moves = part.read(
                progress.steps, choose
            )
            if doubt is not None and doubt.refused:
                return None, doubt
            worst = worst or doubt
            pictures = partial(part.video.frames, part.start, part.stop, masks.size)
            name = str(part.video.path)
            filmed = part.video.size
            views.append(
                CameraView(masks, warnings, name, filmed, pictures, facings, moves)
            )
        return scene(views), worst
    except InputError as error:
        return None, Verdict(str(error), True)


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


def _frames(sources: Sequence[Any]) -> Masks | None:
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


def kind_of(source: Footage) -> Kind:
    """Return what a source names: a built-in motion's name is never a folder, and what is no other file is video.

    A path with a separator and no suffix is read as a folder, even if it does not exist. Images are a film if there
    are several, or pages, and the first is a picture in many colours; else they are masks. Raises InputError for a
    file whose name says that it is no source.
    """
    if isinstance(source, np.ndarray):
        return "masks"
    if isinstance(source, tuple):
        return (
            "pictures"
            if is_photo(source[0]) and (len(source) > 1 or page_count(source[0]) > 1)
            else "masks"
        )
    if (
        isinstance(source, Motion)
        or source in built_in.names()
        or recorded.is_recorded(source)
    ):
        return "motion"
    path = Path(source)
    suffix = path.suffix.lower()
    if suffix in IMAGES and not path.is_dir():
        return kind_of((path,))
    if path.is_dir():
        if (path / "poses.npz").is_file() and (path / "summary.json").is_file():
            raise InputError(
                f"{path}: expected a source, got a track's folder: give the source that it was made from"
            )
        return kind_of(tuple(images)) if (images := images_in(path)) else "masks"
    if not suffix and path.is_file():
        raise InputError(
            f"{path}: expected a name that ends in what the file is, such as .mp4, .npz or .bvh, got no suffix"
        )
    for suffixes, what, instead in UNREAD:
        if suffix in suffixes:
            raise InputError(
                f"{existing(path)}: {what} of {suffix} are not read; {instead} are"
            )
    if suffix in ARRAYS or (not suffix and os.sep in str(source)):
        return "masks"
    return "video" if suffix and suffix not in NO_VIDEO else "motion"
