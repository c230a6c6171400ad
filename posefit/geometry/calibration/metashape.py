"""Agisoft Metashape's cameras.xml.

The file has the cameras from which a chunk was reconstructed, with x right, y down and
z forward. A camera's transform (4, 4) leads from the camera to the chunk. The chunk's
transform, if it has one, leads from the chunk to metres. The principal point is counted
from the middle of the picture, and the centre of the first pixel is 0.5.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.lens import (
    HALF,
    Calibration,
    Place,
    numbers_of,
    pinhole_matrix,
    placed_at,
    seen_from,
    stated,
)
from posefit.geometry.calibration.values import Stored, counts, number_of
from posefit.geometry.calibration.xml_tags import numbers_in, tag_of
from posefit.reading import quoted

# In the order of OpenCV's k1, k2, p1, p2, k3. Metashape swaps p1 and p2: its p1 is
# across, its p2 down.
LENS = ("k1", "k2", "p2", "p1", "k3")
CALIBRATION = {*LENS, "resolution", "f", "cx", "cy", "b1"}
# metres from the origin: a chunk farther away has coordinates of the globe
FARTHEST = 100_000.0


def _read(stored: Stored) -> list[Calibration]:
    sensors = {sensor.get("id"): sensor for sensor in stored.root.iter("sensor")}
    calibrations = list[Calibration]()
    for chunk in stored.root.iter("chunk"):
        worlds = dict(_worlds(chunk))
        for camera in chunk.iter("camera"):
            # a camera that was not aligned has no transform
            if camera.find("transform") is None:
                continue
            if camera.findtext("orientation", "1").strip() != "1":
                raise InputError(
                    f"the key 'orientation' of {quoted(str(camera.get('label')))}, "
                    "which is not read: pictures must be upright as filmed"
                )
            world = worlds.get(camera.get("component_id"), worlds.get(None))
            matrix = numbers_in(camera.findtext("transform")).reshape(4, 4)
            place = seen_from(matrix)
            if world is not None:
                place = _moved(place, *world)
            sensor = sensors.get(camera.get("sensor_id"))
            if sensor is None:
                raise InputError("a camera whose sensor is missing")
            name = str(camera.get("label") or camera.get("id"))
            calibrations.append(
                _camera(name, sensor, place, "free" if world is None else "metres")
            )
    return calibrations


def _worlds(chunk: Any) -> Iterator[tuple[str | None, tuple[Array, Array, float]]]:
    """Yield the transforms of a chunk and its components to the world.

    Each comes with the component's id, or None for the chunk itself. A transform is a
    rotation, a translation and a scale.
    """
    holders = list[tuple[str | None, Any]]()
    if chunk.find("transform") is not None:
        holders.append((None, chunk))
    for part in chunk.iter("component"):
        holders.append((part.get("id"), part))
    for name, holder in holders:
        transform = holder.find("transform")
        if transform is None or transform.find("rotation") is None:
            continue
        rotation = numbers_in(transform.findtext("rotation")).reshape(3, 3)
        translation = numbers_of(numbers_in(transform.findtext("translation")), (3,))
        if np.linalg.norm(translation) > FARTHEST:
            raise InputError(
                "a chunk that is placed on the globe, which is not read: give it local "
                "coordinates"
            )
        yield name, (rotation, translation, number_of(transform.findtext("scale")))


def _moved(place: Place, rotation: Array, translation: Array, scale: float) -> Place:
    """Return a camera's place in the world, from its place in the chunk.

    `rotation`, `translation` and `scale` lead from the chunk to the world.
    """
    turn, moved = place
    position = rotation @ (-scale * turn.T @ moved) + translation
    return placed_at(turn @ rotation.T, position)


def _camera(name: str, sensor: Any, place: Place, scale: Any) -> Calibration:
    # the adjusted one was found from the initial one, and replaces it
    found = sensor.findall("calibration")
    adjusted = [each for each in found if each.get("class") != "initial"]
    if not found:
        raise InputError(f"the sensor of {quoted(name)} without a calibration")
    lens = (adjusted or found)[-1]
    kind = lens.get("type", sensor.get("type", "frame"))
    if kind != "frame":
        raise InputError(f"the lens model {quoted(kind)}, which is not read")
    values = dict[str, float]()
    for value in lens:
        if value.tag not in CALIBRATION and counts(value.text):
            raise InputError(
                f"the lens key {quoted(value.tag)} of {quoted(name)}, which is not read"
            )
        if value.tag in CALIBRATION - {"resolution"}:
            values[value.tag] = number_of(value.text)
    resolution = tag_of(sensor, "resolution")
    width = number_of(resolution.get("width"))
    height = number_of(resolution.get("height"))
    size = np.array([width, height])
    if "f" not in values:
        raise InputError("a calibration without f, of PhotoScan before 1.3")
    focal = [values["f"] + values.get("b1", 0.0), values["f"]]
    centre = 0.5 * size + [values.get("cx", 0.0), values.get("cy", 0.0)]
    return stated(
        name,
        size,
        pinhole_matrix(focal, centre - HALF),
        [values.get(key, 0.0) for key in LENS],
        place,
        scale=scale,
    )


def _recognises(stored: Stored) -> bool:
    return stored.root is not None and stored.root.tag == "document"


METASHAPE = Dialect("Metashape", _recognises, _read)
