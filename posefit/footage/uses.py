"""The kinds of source to which the options of a source apply."""

from collections.abc import Sequence
from typing import NamedTuple

from posefit.errors import InputError
from posefit.footage.kinds import Medium
from posefit.footage.options import SourceOptions
from posefit.reading import quoted

# the kinds of sources, as messages call them
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
    "category": _Use("annotations", ["masks"]),
    "holes": _Use("masks", ["masks"]),
    "height": _Use("footage", _FOOTAGE),
    "person": _Use("footage", _FOOTAGE),
    "size": _Use("motions", ["motion"]),
}


def check_used(medium: Medium, options: SourceOptions) -> None:
    """Raise InputError if a given option does not apply to this kind of source.

    Args:
        medium: The kind of source.
        options: The options; None if not given.
    """
    for name, use in _USED_FOR.items():
        value = getattr(options, name)
        if medium not in use.media and value is not None:
            raise useless_for(medium, name, value, use.where)
    if medium == "motion" or options.cameras:
        return
    # without these files nothing is left that has an axis or a unit
    files = "calibrations and files of motions"
    if options.up is not None:
        raise useless_for(medium, "up", options.up, files)
    if options.unit is not None and options.asf is None:
        raise useless_for(medium, "unit", options.unit, files)


def useless_for(medium: Medium, name: str, value: object, where: str) -> InputError:
    """Return the error for an option that does not apply to this kind of source.

    `where` says which sources the option is for.
    """
    return InputError(
        f"{name} applies only to {where}, got {quoted(value)} "
        f"for {_MEDIA[medium]}: leave it out"
    )
