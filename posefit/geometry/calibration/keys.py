"""Unknown keys: whether, by their names, they describe the lens or the place.

The keys that a program writes are listed with its dialect. Users choose names too, or
add values. An unknown key with numbers is an error, unless its name says that
they describe neither the lens nor the place.
"""

import re
from collections.abc import Collection, Mapping
from typing import Any

from posefit.errors import InputError
from posefit.geometry.calibration.values import counts, matrix_of, plain, says
from posefit.reading import quoted

# keys that seem to describe a lens, such as radial_distortion, kappa1, k7, p3, s1, skew
# or xi; not distance, lens_mm or lens_serial
_OF_LENS = re.compile(
    r".*(dist(?!an)|coef|lens(?!.*(focal|mm|serial))|fish|radial|tangential|omni|prism"
    r"|skew|shear).*"
    r"|(k|kappa|p|b)[0-9]+|k|kappa|s[1-9]|tau[0-9xy]*|alphac?|xi"
)
# keys that seem to state a camera's place in a way that is not read, because programs
# differ in axes and directions
_OF_PLACE = re.compile(
    r"(camera|cam|c|world|w)(to|2|from)(camera|cam|c|world|w)(matrix)?|matrixworld"
    r"|tcw|twc|(camera)?(transform|extrinsics?|pose)(matrix)?|transformmatrix"
    r"|rt|q|qvec|quat|quaternion"
    r"|(camera)?(position|location|orientation|euler|eulerangles)"
    r"|(camera|cam)?(pitch|yaw|roll|heading|pan|tilt|azimuth|elevation|height)"
    r"(deg|degrees|rad|m)?"
)
_SUSPECT = re.compile(f"{_OF_LENS.pattern}|{_OF_PLACE.pattern}")
# keys whose numbers describe neither the lens nor the place
_HARMLESS = re.compile(
    # how good the calibration is, when it was made, and with which target
    r".*(error|rms|residual|reproj|accura|deviation|std|date|stamp).*"
    r"|.*time(?!.*(offset|shift|delay|lag)).*"
    r"|.*(board|square|chess|charuco|aruco|marker|pattern|corner|grid).*"
    r"|.*(points?|images?|views?|frames?|samples?)|(nr|num|number|count).*|.*count"
    # the camera's identity, and how it takes pictures
    r"|.*(id|ids|index|serial|serialnumber|sn|port|name|version|flags?|fps|rate|ratehz)"
    r"|.*(exposure|gain|brightness|gamma|shutter|iso|whitebalance|format|channels?)"
    r"|fov.*|.*fov|angleofview|cameraangle[xy]|distance.*|baseline.*|aspectratio"
    r"|.*(focal(length)?|lens|sensor.*|pixelsize.*|aperture.*)(mm|um)?"
    r"|depth(scale|units?)"
    # values that follow from the numbers that are read
    r"|(optimal|new).*|rectif.*|e|f|essential(matrix)?"
    r"|fundamental(matrix)?"
)
# keys of a matrix (3, 4); with two numbers, `p` describes a lens
_PROJECTIONS = ("p", "projectionmatrix")
# lens models without a polynomial, which texts may state under any key
_MODEL = re.compile(
    r"(opencv|radial|simpleradial|thinprism)*(fisheye|equidistant|equisolid(angle)?"
    r"|stereographic|kannalabrandt|kb)[0-9]*|omni(directional)?|equirectangular"
    r"|spherical|doublesphere|mei|e?ucm|fov"
)
# keys whose texts only name something
_NAME = re.compile(r".*(id|name|serial|serialnumber|label|port|comment|notes?|path)")
# keys of texts that would change the meaning of the numbers
_CONVENTION = re.compile(r".*(convention|coordinate|handed|axes|axis).*")


def unread(table: Mapping[str, Any], known: Collection[str]) -> dict[str, Any]:
    """Return the entries of a table whose keys are not known."""
    return {key: value for key, value in table.items() if key not in known}


def check_others(name: str, others: Mapping[str, Any], *, placed: bool = False) -> None:
    """Raise InputError for an unread key that may describe the lens or the place.

    Args:
        name: The camera's name in the file.
        others: The keys that were not read, and their values.
        placed: Whether the camera's place was read. Other keys of a place then say the
            same, and are ignored.

    Raises:
        InputError: A key may describe the lens, or the place.
    """
    _check_suspects(name, others, placed=placed)
    for key, value in others.items():
        word = plain(key)
        if (
            isinstance(value, str)
            and _MODEL.fullmatch(plain(value))
            and not _NAME.fullmatch(word)
        ):
            raise InputError(
                f"the lens model {quoted(value)} under the key {quoted(key)} of "
                f"{quoted(name)}, which is not read"
            )
        if word in _PROJECTIONS and _is_projection(value):
            if not placed and _is_turned(value):
                raise _unread_place(name, key)
        elif isinstance(value, dict):
            # not deeper: aliases in YAML may repeat one table again and again
            inner = {k: v for k, v in value.items() if not isinstance(v, dict)}
            _check_suspects(name, inner, placed=placed)
        elif not _is_harmless(word) and (
            counts(value) or (_CONVENTION.fullmatch(word) and says(value))
        ):
            raise InputError(
                f"the key {quoted(key)} of {quoted(name)}, which is not known: delete "
                "it if it describes neither the lens nor the camera's position"
            )


def _is_harmless(word: str) -> bool:
    # `_check_suspects` found no numbers in a key that matches `_SUSPECT`
    return bool(_SUSPECT.fullmatch(word) or _HARMLESS.fullmatch(word))


def _is_projection(value: Any) -> bool:
    """Return whether a value is twelve numbers, a matrix (3, 4)."""
    try:
        return matrix_of(value).size == 12
    except (ValueError, TypeError, KeyError):
        return False


def _is_turned(value: Any) -> bool:
    """Return whether a projection (3, 4) turns the world.

    A camera that does not turn it has fx 0 cx, 0 fy cy, 0 0 1 in the first columns.
    """
    turned = matrix_of(value).reshape(3, 4)
    focal = abs(turned[0, 0])
    return bool(max(abs(turned[1, 0]), *(focal * abs(turned[2, :2]))) > 1e-3 * focal)


def _unread_place(name: str, key: str) -> InputError:
    return InputError(
        f"the key {quoted(key)} of {quoted(name)}, which is not read: give the "
        "rotation and the translation from the world to the camera"
    )


def _check_suspects(name: str, others: Mapping[str, Any], *, placed: bool) -> None:
    """Raise InputError for a key that seems to describe the lens or the place.

    A key of a place is an error only if the camera was not placed.
    """
    for key, value in others.items():
        word = plain(key)
        if _OF_LENS.fullmatch(word) and counts(value):
            raise InputError(
                f"the lens key {quoted(key)} of {quoted(name)}, which is not known"
            )
        if (
            _OF_PLACE.fullmatch(word)
            and not placed
            and (isinstance(value, dict) or counts(value))
        ):
            raise _unread_place(name, key)
