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
from posefit.footage.named import OneSource, sources_of
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
# what a source contains: a motion, masks, a video whose file states its rate, or
# pictures of a film whose rate a user may state
Medium = Literal["motion", "masks", "video", "pictures"]
# what a reader takes, by `_material_of`: the images of a folder are listed, and files
# are not opened yet
Material = Motion | str | Path | Images | NDArray[Any]


class Kind(NamedTuple):
    """A kind of source and its reader: `view` for masks, `film` for other footage.

    A motion has neither, because `motion.clips` reads motions and their files.
    """

    medium: Medium
    recognises: Callable[[Material], bool]
    # takes (material, frames, label or category, fps), and returns the view
    view: Callable[[Any, Range, Any, float | None], View] | None = None
    # takes (material, fps, width), and returns the film, scaled down to the width
    film: Callable[[Any, float | None, int], Video] | None = None
    # takes (material, fps), and returns the number of the first frame; None if frames
    # are counted from 0
    first: Callable[[Any, float | None], int] | None = None
    has_categories: bool = False  # whether a label may be a category's name


def _is_film(material: Material) -> bool:
    """Return whether images are a film: several pictures, the first in many colours."""
    if not isinstance(material, Images):
        return False
    first = material.files[0]
    return is_photo(first) and (len(material.files) > 1 or page_count(first) > 1)


def _is_video(material: Material) -> bool:
    """Return whether a file may be a video: any suffix that has no other meaning.

    Raises InputError for the suffixes in `UNREAD`.
    """
    if not isinstance(material, Path):
        return False
    suffix = material.suffix.lower()
    for unread in UNREAD:
        if suffix in unread.suffixes:
            raise InputError(
                f"{existing(material)}: {unread.what} of {suffix} are not read; "
                f"{unread.instead} are"
            )
    return suffix not in ("", *NO_VIDEO)


def _ends_in(suffix: str) -> Callable[[Material], bool]:
    return lambda material: (
        isinstance(material, Path) and material.suffix.lower() == suffix
    )


def _first_of_motion(material: Material, fps: float | None) -> int:
    """Return the number of a motion's first frame, which only a cut motion states."""
    return material.first_at(fps or FPS) if isinstance(material, Motion) else 0


# The first kind that recognises a source reads it. A new kind goes before the video,
# which takes files of every suffix, and the motion, which takes every name.
KINDS = (
    Kind("masks", lambda material: isinstance(material, np.ndarray), view=read_array),
    Kind(
        "masks",
        _ends_in(".npz"),
        view=read_npz,
        first=lambda material, _: first_number(material),
    ),
    Kind("masks", _ends_in(".npy"), view=read_npy),
    Kind("masks", _ends_in(ANNOTATIONS), view=read_annotations, has_categories=True),
    Kind("pictures", _is_film, film=Video.of_pictures),
    Kind("masks", lambda material: isinstance(material, Images), view=read_images),
    Kind("video", _is_video, film=lambda material, _, width: Video.of(material, width)),
    Kind("motion", lambda _: True, first=_first_of_motion),  # names need no suffix
)


@dataclass(frozen=True, eq=False)
class Resolved:
    """A source whose kind is known and whose files are found. Made by `resolve`."""

    medium: Medium
    named: Sequence[OneSource]  # what the user named, one per camera
    names: Sequence[str]  # what messages call each
    materials: Sequence[Material]  # what the reader of each takes
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
    materials = [_material_of(each) for each in named]
    kinds = [_kind_of(material) for material in materials]
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
    materials = _with_numbers(materials)
    names = [_name_of(material) for material in materials]
    return Resolved(medium, named, names, materials, kinds)


def _check_each_once(named: Sequence[OneSource]) -> None:
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


def _kind_of(material: Material) -> Kind:
    """Return the first kind that recognises a source. The last one takes anything."""
    return next(kind for kind in KINDS if kind.recognises(material))


def _with_numbers(materials: Sequence[Material]) -> list[Material]:
    """Return materials whose images are in the order of the numbers in their names.

    Cameras are paired by these numbers if all of them have images. If another camera
    has an .npz file, say, each camera's images are numbered alone.
    """
    images = [material for material in materials if isinstance(material, Images)]
    if len(images) == len(materials):
        return [*numbered_together(images)]
    numbered = list[Material]()
    for material in materials:
        if isinstance(material, Images):
            (material,) = numbered_together([material])
        numbered.append(material)
    return numbered


def first_of(source: Resolved, fps: float | None = None) -> int:
    """Return the number of the first frame that all cameras have.

    Args:
        source: The source.
        fps: Frames per second, at which a motion is resampled.
    """
    first = 0
    for kind, material in zip(source.kinds, source.materials, strict=True):
        if kind.first is not None:
            first = max(first, kind.first(material, fps))
    return first


def _material_of(source: OneSource) -> Material:
    """Return what the reader of a source takes.

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


def _name_of(material: Material) -> str:
    """Return what messages call a source."""
    if isinstance(material, Images | Motion):
        return material.name
    return "masks" if isinstance(material, np.ndarray) else str(material)
