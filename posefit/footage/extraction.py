"""Options for the segmentation of the person in a video."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from inspect import Parameter
from pathlib import Path
from typing import Any, cast

from posefit.errors import InputError
from posefit.fitting.validation import plugin_errors
from posefit.footage.choice import Choice, checked_person
from posefit.footage.quality import PEOPLE_SEGMENTER
from posefit.reading import quoted
from posefit.registry import registry
from posefit.settings import check
from posefit.silhouette.foreground import Film, Segmenter

Box = tuple[int, int, int, int]  # x, y, width, height

DEFAULT_SEGMENTER = "mixture"
BACKGROUND_SEGMENTER = "mean"  # the default if a background is given
WIDTH = 640  # pixels: wider videos are scaled down to this width
WIDTHS = (36, 8192)  # pixels: the widths that a user may set


@dataclass(frozen=True)
class Extraction:
    """How the person is segmented in a video.

    Args:
        method: Name of a segmenter. By default a "mixture" of Gaussians is learned from
            the whole video, or the "mean" of `background` if that is given. If
            "mediapipe" is installed, a track by default uses the better of both, see
            `ways`.
        background: Frames without a person, as A:B, or an image.
        roi: x, y, width and height of the region to search, in the video's pixels.
        ignore: An image whose bright pixels are never known, such as a tree in front.
        width: Videos that are wider are scaled down to this width.
        person: Which of several people is followed, see `People.chosen`. A point is in
            the video's pixels. The option `person` of a track does the same.
        settings: The segmenter's own settings.

    Raises:
        InputError: A setting is missing, unknown or out of range.

    Example:
        >>> from posefit import Extraction
        >>> extraction = Extraction(roi=(0, 420, 1520, 532), person=2)
        >>> extraction.name
        'mixture'
    """

    method: str | None = None
    background: str | None = None
    roi: Box | None = None
    ignore: str | Path | None = None
    width: int = WIDTH
    person: Choice | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        least, most = WIDTHS
        if not least <= self.width <= most:
            raise InputError(
                f"width must lie in {least} to {most} pixels, got {self.width}"
            )
        if self.person is not None:
            person = checked_person("person", self.person)
            object.__setattr__(self, "person", person)
        offer = registry().offer("segmenter", self.name)
        settings = dict(self.settings)
        if self.background is not None:
            self._check_takes_background()
            settings["background"] = self.background
        settings = dict(check(self.name, offer.factory, settings))
        object.__setattr__(self, "settings", settings)
        for setting in offer.settings:
            if setting.default is Parameter.empty and setting.name not in settings:
                given = "given"
                if setting.name == "background":
                    given = "frames A:B or an image"
                raise InputError(
                    f"{setting.name} must be {given} for the method {self.name}, "
                    "got none"
                )

    def _check_takes_background(self) -> None:
        """Raise InputError if the segmenter does not take a background."""
        takers = list[str]()
        for offer in registry().offers["segmenter"].values():
            if any(setting.name == "background" for setting in offer.settings):
                takers.append(offer.name)
        if self.name not in takers:
            raise InputError(
                f"background applies only to the method {' or '.join(takers)}, "
                f"got {quoted(self.background)} with {self.name}: leave it out"
            )

    @property
    def name(self) -> str:
        """The segmenter's name."""
        return segmenter_name(self.method, self.background)

    def ways(self, cameras: int) -> "list[Extraction]":
        """Return the extractions that a track tries, in their order.

        A track uses the first one without doubtful masks. If the user chose nothing,
        "mediapipe" is tried, too, if it is installed. With one camera it comes first,
        because its landmarks show which leg is the left one.
        """
        if self.method or self.background or self.settings:
            return [self]
        other = registry().offers["segmenter"].get(PEOPLE_SEGMENTER)
        if other is None or other.missing:
            return [self]
        both = [self, replace(self, method=PEOPLE_SEGMENTER)]
        return both[::-1] if cameras == 1 else both

    def segmenter(self, film: Film) -> Segmenter:
        """Return the segmenter, trained on a film.

        Raises InputError if a setting does not fit the film.
        """
        offer = registry().offer("segmenter", self.name)
        with plugin_errors(offer.label, "it", passed=(ValueError, ImportError)):
            return cast(Segmenter, offer.factory(film, **self.settings))


def segmenter_name(method: str | None, background: str | None) -> str:
    """Return the name of the segmenter; the default depends on the background."""
    return method or (DEFAULT_SEGMENTER if background is None else BACKGROUND_SEGMENTER)
