"""The kinds of source to which the options of a source apply."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from posefit.errors import InputError
from posefit.footage.kinds import Medium
from posefit.reading import quoted

# the same, as messages call it
_MEDIA: dict[Medium, str] = {
    "motion": "a motion",
    "masks": "masks",
    "video": "a video",
    "pictures": "pictures",
}


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
