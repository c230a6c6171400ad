"""Find out which camera took which source."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from posefit.errors import InputError
from posefit.footage.images import IMAGES
from posefit.footage.readers import ARRAYS
from posefit.footage.straightening import calibration_for
from posefit.geometry.calibration import Calibration, misreading, read_calibrations
from posefit.geometry.camera import Camera
from posefit.reading import cut

Pairing = tuple[int, ...]  # for each source, the index of its camera


def read_cameras(
    cameras: Sequence[Camera | Calibration | str | Path],
) -> list[Camera | Calibration]:
    """Return cameras, after reading those that are files.

    A file may have several cameras, which are for several views in their order. Raises
    InputError if a file is not a calibration.
    """
    known = list[Camera | Calibration]()
    for camera in cameras:
        if isinstance(camera, Camera | Calibration):
            known.append(camera)
            continue
        mistake = _mistaken_for_calibration(Path(camera))
        if mistake:
            raise InputError(
                f"{camera}: expected a calibration of the camera, got {mistake}"
            )
        known += read_calibrations(camera)
    return known


def _mistaken_for_calibration(path: Path) -> str:
    """Return what a path is if it cannot be a calibration, or else ""."""
    suffix = path.suffix.lower()
    if suffix in ARRAYS:
        return (
            "arrays: a calibration is a text, as json.dump({name: array.tolist() for "
            "name, array in numpy.load(FILE).items()}, ...) writes it"
        )
    if suffix in IMAGES:
        return "an image"
    return "a folder" if path.is_dir() else ""


def calibrated(
    cameras: Sequence[Camera | Calibration | str | Path],
    filmed: Sequence[tuple[int, int] | None],
    names: Sequence[str] = (),
) -> list[Camera | Calibration]:
    """Return the camera of each view, or an empty list for one view without a camera.

    Args:
        cameras: Cameras, calibrations, or their files, in the order of the views.
        filmed: Width and height of each view's video; None for masks.
        names: Names of the views' sources. If the cameras have the same names, they are
            paired by these and not by order.

    Raises:
        InputError: Cameras and views do not fit each other.
    """
    known = read_cameras(cameras)
    views = len(filmed)
    if not known and views > 1:
        raise InputError(
            f"camera must be given for each of several views, {views}, got none"
        )
    if known and len(known) != views:
        calibrations = [each for each in known if isinstance(each, Calibration)]
        came = ", ".join(calibration.name for calibration in calibrations)
        chosen = ""
        if len(known) > views and came:
            chosen = f": {cut(came)}; FILE:NAME is one of a file"
        raise InputError(
            f"camera must be given for each view, {views}, got {len(known)}{chosen}"
        )
    if views > 1 and any(
        isinstance(camera, Calibration) and camera.rotation is None for camera in known
    ):
        raise InputError(
            "with several cameras, each calibration must have a rotation and a "
            "translation, got a file without rotation"
        )
    if views > 1:
        _check_places(known)
        # each file was checked by itself, but a file may be one camera
        files = [camera for camera in known if isinstance(camera, Calibration)]
        of_one_unit = len({camera.scale for camera in files}) == 1
        if of_one_unit and (wrong := misreading(files)):
            raise InputError(
                f"cameras must be placed from the world to the camera, got {wrong}"
            )
    if views > 1 and len(names) == views:
        known = [known[k] for k in order_by_name(known, names)]
    for camera, size in zip(known, filmed, strict=False):
        if isinstance(camera, Calibration) and size is not None:
            calibration_for(camera, size, scaled=False)
    return known


def _check_places(cameras: Sequence[Camera | Calibration]) -> None:
    """Raise InputError if two cameras are at one place and look the same way."""
    earlier = list[tuple[bytes, str]]()  # the place and the name of each camera
    for number, camera in enumerate(cameras, 1):
        if camera.rotation is None or camera.translation is None:
            continue
        place = np.column_stack([camera.rotation, camera.translation])
        name = camera.name if isinstance(camera, Calibration) else f"camera {number}"
        for other_place, other_name in earlier:
            if other_place == place.tobytes():
                raise InputError(
                    "cameras must be in different places, got the same place and "
                    f"direction for {other_name} and {name}"
                )
        earlier.append((place.tobytes(), name))


def order_by_name(
    cameras: Sequence[Camera | Calibration], sources: Sequence[str]
) -> list[int]:
    """Return which camera took each source, by their names or else in order.

    Words that all names share and leading zeros do not count: walk-a.mp4 and walk-b.mp4
    are from the cameras a and b, or cam_a and cam_b.

    Args:
        cameras: The cameras; only calibrations have names.
        sources: The names of the sources, one per camera.

    Returns:
        For each source, the index of its camera.

    Raises:
        InputError: The names can be paired in several ways.
    """
    in_order = list(range(len(cameras)))
    names = [camera.name for camera in cameras if isinstance(camera, Calibration)]
    if len(names) < len(cameras):
        return in_order
    # files may be named after the cameras, or the folders that they are in
    stems = [Path(source).stem for source in sources]
    folders = [Path(source).parent.name for source in sources]
    orders = set[Pairing]()
    for given in (stems, folders, sources):
        order = _order_by_words(names, given)
        if order is not None:
            orders.add(order)
    if not orders:
        order = _order_by_part(names, stems)
        if order is not None:
            orders.add(order)
    if len(orders) > 1:
        raise InputError(
            "cannot tell which camera took which source, got "
            f"{cut(', '.join(names))} for {cut(', '.join(sources))}: "
            "give one calibration file for each camera, in the order of the sources "
            "and with names that do not occur in theirs"
        )
    return list(*orders) if orders else in_order


def _order_by_words(names: Sequence[str], given: Sequence[str]) -> Pairing | None:
    """Return the order in which cameras and sources have the same names; None if none.

    Names are compared by all of their words, or else without the words that all share.
    """
    for words_of in (_all_words, _own_words):
        of_sources = words_of(given)
        of_cameras = words_of(names)
        are_unique = len(set(of_sources)) == len(of_sources)
        if are_unique and set(of_sources) == set(of_cameras):
            return tuple(of_cameras.index(words) for words in of_sources)
    return None


def _order_by_part(names: Sequence[str], given: Sequence[str]) -> Pairing | None:
    """Return the order in which the name of each source contains one camera's name.

    None if a source contains none or several of them, or if two contain the same.
    """
    words = [f" {' '.join(_words(name))} " for name in names]
    order = list[int]()
    for source in given:
        text = f" {' '.join(_words(source))} "
        contained = [k for k, name in enumerate(words) if name.strip() and name in text]
        if len(contained) != 1:
            return None
        order += contained
    return tuple(order) if len(set(order)) == len(names) else None


def _words(name: str) -> tuple[str, ...]:
    """Return the words and numbers of a name, in lower case, without leading zeros."""
    words = list[str]()
    for part in re.findall(r"[0-9]+|[^\W\d_]+", name.casefold()):
        if part.isdigit():
            part = part.lstrip("0") or "0"
        words.append(part)
    return tuple(words)


def _all_words(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the words of each name."""
    return [_words(name) for name in names]


def _own_words(names: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the words of each name without common ones at the beginning or the end."""
    every = _all_words(names)
    shortest = min(len(words) for words in every)
    before = 0
    while before < shortest and len({words[before] for words in every}) == 1:
        before += 1
    after = 0
    remaining = shortest - before
    while after < remaining and len({words[-1 - after] for words in every}) == 1:
        after += 1
    return [words[before : len(words) - after] for words in every]
