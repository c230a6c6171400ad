"""Segmenters that compare each frame with a still background."""

from itertools import islice

from posefit.fitting.check import at_least, positive
from posefit.footage.views import span
from posefit.silhouette.foreground import (
    HISTORY,
    SAMPLES,
    THRESHOLD,
    Film,
    GivenMasks,
    Mixture,
    Still,
    mean_background,
    median_background,
)


def learned_mixture(
    film: Film, *, history: int = HISTORY, threshold: float = THRESHOLD
) -> Mixture:
    """OpenCV's MOG2: an adaptive mixture of Gaussians for each pixel's background.

    It is learned from the whole video.

    Settings:
        history: Number of frames that the mixture remembers, 1 or more.
        threshold: Squared distance from the nearest Gaussian, in standard deviations,
            above which a pixel is foreground; above 0.
    """
    at_least("history", history, 1)
    positive("threshold", threshold)
    return Mixture(film.frames(), history, threshold)


def learned_median(film: Film, *, samples: int = SAMPLES) -> Still:
    """Each pixel's background is its median over some frames of the whole video.

    The person may walk in these frames.

    Settings:
        samples: Number of frames, spread over the video, 1 or more; all are in memory
            at once.
    """
    at_least("samples", samples, 1)
    step = max(1, len(film) // samples)
    return median_background(list(islice(film.frames(step=step), samples)))


def given_mean(film: Film, *, background: str) -> Still:
    """Each pixel's background is its mean over frames of the empty scene.

    Settings:
        background: Frames of the empty scene as A:B, or the file of a picture of it;
            `--background` sets this.
    """
    start, colon, stop = background.partition(":")
    if colon and (start + stop).isdigit() and stop:
        return mean_background(
            film.frames(*span((int(start or 0), int(stop)), len(film)))
        )
    return mean_background([film.picture(background)])


def given_masks(_film: Film) -> GivenMasks:
    """The frames are masks already. Bright pixels are the person."""
    return GivenMasks()
