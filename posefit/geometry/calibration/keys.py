"""What the name of a key says that no dialect reads: of a lens, of a place, or of neither.

Programs have a list of the keys that they write. Where users choose names, or add values, a key that
is not read is refused where it holds numbers, unless its name says that they describe neither the
lens nor the place.
"""

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from posefit.errors import InputError
from posefit.geometry.calibration.values import counts, plain, says
from posefit.reading import quoted

# keys that seem to describe a lens, such as radial_distortion, kappa1, k7, p3, s1, skew or xi; not distance, lens_mm or
# lens_serial
_OF_LENS = re.compile(
    r".*(dist(?!an)|coef|lens(?!.*(focal|mm|serial))|fish|radial|tangential|omni|prism|skew|shear).*"
    r"|(k|kappa|p|b)[0-9]+|k|kappa|s[1-9]|tau[0-9xy]*|alphac?|xi"
)
# keys that seem to say where a camera stands, in a way that is not read: axes and directions differ between programs
_OF_PLACE = re.compile(
    r"(camera|cam|c|world|w)(to|2|from)(camera|cam|c|world|w)(matrix)?|matrixworld|tcw|twc"
    r"|(camera)?(transform|extrinsics?|pose)(matrix)?|transformmatrix|rt|q|qvec|quat|quaternion"
    r"|(camera)?(position|location|orientation|euler|eulerangles)"
    r"|(camera|cam)?(pitch|yaw|roll|heading|pan|tilt|azimuth|elevation|height)(deg|degrees|rad|m)?"
)
_SUSPECT = re.compile(f"{_OF_LENS.pattern}|{_OF_PLACE.pattern}")
# keys whose numbers describe neither the lens nor the place
_HARMLESS = re.compile(
    # how good it is, and when and of what it was made
    r".*(error|rms|residual|reproj|accura|deviation|std|date|time|stamp).*"
    r"|.*(board|square|chess|charuco|aruco|marker|pattern|corner|grid).*"
    r"|.*(points?|images?|views?|frames?|samples?)|(nr|num|number|count).*|.*count"
    # which camera it is, and how it takes pictures
    r"|.*(id|ids|index|serial|serialnumber|sn|port|name|version|flags?|fps|rate)"
    r"|.*(exposure|gain|brightness|gamma|shutter|iso|whitebalance|format|channels?)"
    r"|fov.*|.*fov|angleofview|cameraangle[xy]|distance.*|baseline.*|aspectratio"
    r"|.*(focal(length)?|lens|sensor.*|pixelsize.*|aperture.*)(mm|um)?|depth(scale|units?)"
    # what follows from these numbers
    r"|(optimal|new).*|rectif.*|projectionmatrix|e|f|essential(matrix)?|fundamental(matrix)?"
)
PROJECTION = "p"  # a matrix (3, 4), and not the two numbers of a lens
# texts that would change what the numbers mean
_CONVENTION = re.compile(r".*(convention|coordinate|handed|axes|axis).*")


def check_others(name: str, others: Mapping[str, Any], *, placed: bool = False) -> None:
    """Raise InputError for a key of a camera that was not read, and may say something of the lens or of the place.

    Beside a place that is read, others say the same.
    """
    _check_suspects(name, others, placed=placed)
    for key, value in others.items():
        word = plain(key)
        if isinstance(value, dict):
            # not deeper, as an alias of YAML may give the same table again and again
            inner = {k: v for k, v in value.items() if not isinstance(v, dict)}
            _check_suspects(name, inner, placed=placed)
        elif not _is_harmless(word, value) and (
            counts(value) or (_CONVENTION.fullmatch(word) and says(value))
        ):
            raise InputError(
                f"the key {quoted(key)} of {quoted(name)}, which is not known: leave it out where it "
                "describes neither the lens nor the place"
            )


def _is_harmless(word: str, value: Any) -> bool:
    # suspects were checked before, and said nothing
    return bool(_SUSPECT.fullmatch(word) or _HARMLESS.fullmatch(word)) or (
        word == PROJECTION and np.size(value) == 12
    )


def _check_suspects(name: str, others: Mapping[str, Any], *, placed: bool) -> None:
    """Raise InputError for a key whose name seems to describe the lens, or the place of a camera without one."""
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
            raise InputError(
                f"the key {quoted(key)} of {quoted(name)}, which is not read: where a camera stands is its "
                "rotation and translation, from the world to the camera"
            )
