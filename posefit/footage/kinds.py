"""Recognise the kind of a source, and find its files.

    from posefit.footage.kinds import resolve

    source = resolve(["a.mp4", "b.mp4"])  # finds the kind, and the files per camera

Each kind of source is a line of `KINDS`: how it is recognised, and its reader. A reader
returns a `View`, or a film that a segmenter turns into a `View`.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.errors import InputError
from posefit.files import opencv_name
from posefit.footage.annotations import ANNOTATIONS, read_annotations
from posefit.footage.images import IMAGES, is_photo, page_count
from posefit.footage.named import Footage, sources_of
from posefit.footage.numbering import Images, images_in, numbered_together
from posefit.footage.readers import (
    ARRAYS,
    first_number,
    read_array,
    read_images,
    read_npy,
    read_npz,
)
from posefit.footage.video import Video
from posefit.footage.views import Range, View
from posefit.motion import built_in, recorded
from posefit.motion.clips import FPS, MOTIONS
from posefit.motion.motion import Motion
from posefit.reading import existing

# suffixes of other inputs: what ends in one of them is never tried as a video
NO_VIDEO = (*IMAGES, *MOTIONS, *ARRAYS, ANNOTATIONS, ".asf")


class _Unread(NamedTuple):
    """Suffixes that users may well try, but that posefit does not read."""

    suffixes: Sequence[str]
    what: str  # what such files contain
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
            *(".xml", ".csv", ".txt", ".yaml", ".yml", ".toml", ".zip"),
            *(".mat", ".h5", ".hdf5", ".pkl", ".pickle", ".pt", ".pth"),
        ),
        what="masks and motions",
        instead=f"masks as images or {', '.join(ARRAYS)} and {ANNOTATIONS}, "
        f"and motions as {' and '.join(MOTIONS)}",
    ),
)
# what a source contains: a motion, masks, a video file, or pictures of a film
Medium = Literal["motion", "masks", "video", "pictures"]
# where a source is, by `_place`: images are listed, and other names are not opened
Place = Motion | str | Path | Images | NDArray[Any]


class Kind(NamedTuple):
    """A kind of source and its reader: `view` for masks, `film` for pictures.

    A motion has neither; `load_motion` reads it.
    """

    medium: Medium
    recognises: Callable[[Place], bool]
    # takes (place, frames, label or category, fps), and returns the view
    view: Callable[[Any, Range, Any, float | None], View] | None = None
    # takes (place, fps, width), and returns the film, scaled down to the width
    film: Callable[[Any, float | None, int], Video] | None = None
    # takes (place, fps), and returns the number of the first frame; None if frames are
    # counted from 0
    first: Callable[[Any, float | None], int] | None = None
    has_categories: bool = False  # whether a label may be a category's name


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


def _first_of_motion(place: Place, fps: float | None) -> int:
    """Return the number of a motion's first frame, which only a cut motion states."""
    return place.first_at(fps or FPS) if isinstance(place, Motion) else 0


# the first kind that recognises a source reads it
KINDS = (
    Kind("masks", lambda place: isinstance(place, np.ndarray), view=read_array),
    Kind(
        "masks",
        _ends_in(".npz"),
        view=read_npz,
        first=lambda place, _: first_number(place),
    ),
    Kind("masks", _ends_in(".npy"), view=read_npy),
    Kind("masks", _ends_in(ANNOTATIONS), view=read_annotations, has_categories=True),
    Kind("pictures", _is_film, film=Video.of_pictures),
    Kind("masks", lambda place: isinstance(place, Images), view=read_images),
    Kind("video", _is_video, film=lambda place, _, width: Video.of(place, width)),
    Kind("motion", lambda _: True, first=_first_of_motion),  # names need no suffix
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
    _check_each_once(named)
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


def _check_each_once(named: Sequence[Footage]) -> None:
    """Raise InputError if two cameras have the same source."""
    earlier = list[Any]()
    for each in named:
        key = each
        if isinstance(each, str | Path):
            key = Path(each).resolve()
        if any(key is other or _is_same(key, other) for other in earlier):
            what = "the same array"
            if not isinstance(each, np.ndarray):
                what = str(each[0] if isinstance(each, tuple) else each)
            raise InputError(f"each camera must have its own source, got {what} twice")
        earlier.append(key)


def _is_same(one: Any, other: Any) -> bool:
    """Return whether two sources are equal; arrays are not compared."""
    return isinstance(one, Path | tuple) and type(one) is type(other) and one == other


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


def first_of(source: Resolved, fps: float | None = None) -> int:
    """Return the number of the first frame that all cameras have.

    Args:
        source: The source.
        fps: Frames per second, at which a motion is resampled.
    """
    first = 0
    for kind, place in zip(source.kinds, source.places, strict=True):
        if kind.first is not None:
            first = max(first, kind.first(place, fps))
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
            f"{path}: expected a file name with a suffix such as .mp4, .npz or .bvh, "
            "got none: rename it"
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
            f"{folder}: expected a source, got the folder of a track: give the video, "
            "masks or motion that it was made from"
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
