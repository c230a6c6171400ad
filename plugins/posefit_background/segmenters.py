"""Segmenters that compare each frame with a still background."""

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
    """Each pixel's background is an adaptive mixture of Gaussians, learned from the whole video: OpenCV's MOG2.

    Settings:
        history: frames that it remembers, 1 or more.
        threshold: squared standard deviations from the nearest Gaussian, from which on a pixel is foreground; above 0.
    """
    at_least("history", history, 1)
    positive("threshold", threshold)
    return Mixture(film.frames(), history, threshold)


def learned_median(film: Film, *, samples: int = SAMPLES) -> Still:
    """Each pixel's background is its median over some frames of the whole video, before which a person may walk.

    Settings:
        samples: frames, spread over the video, 1 or more; all are in memory at once.
    """
    at_least("samples", samples, 1)
    step = max(1, len(film) // samples)
    return median_background(
        [
            image
            for image, _ in zip(film.frames(step=step), range(samples), strict=False)
        ]
    )


def given_mean(film: Film, *, background: str) -> Still:
    """Each pixel's background is its mean over frames without a person, or a picture of the empty scene.

    Settings:
        background: these frames as A:B, or the picture's file; `--background` sets it.
    """
    start, colon, stop = background.partition(":")
    if colon and (start + stop).isdigit() and stop:
        return mean_background(
            film.frames(*span((int(start or 0), int(stop)), len(film)))
        )
    return mean_background([film.picture(background)])


def given_masks(_film: Film) -> GivenMasks:
    """The frames are masks already: what is bright is the person."""
    return GivenMasks()
