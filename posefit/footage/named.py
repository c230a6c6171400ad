"""What a user names, as one source per camera: files, arrays, motions and lists."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.errors import InputError
from posefit.footage.images import IMAGES, PAGED, page_count
from posefit.motion.clips import Source
from posefit.motion.motion import Motion
from posefit.reading import cut, quoted

# what a user names for one camera: a motion or a file, masks (T, H, W), or image files
OneSource = Source | NDArray[Any] | tuple[Path, ...]


def sources_of(source: Any) -> list[OneSource]:
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
        raise InputError("source must not be an empty list")
    frames = _frames(source)
    return [_source_of_camera(each) for each in source] if frames is None else [frames]


def _source_of_camera(source: Any) -> OneSource:
    """Return the source of one of several cameras."""
    if not isinstance(source, Sequence) or isinstance(source, str | Motion):
        (only,) = sources_of(source)
        return only
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
            "source must be images with one page each, or one file with several pages "
            f"for each camera, got {files[pages.index(1)]} with one page"
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
