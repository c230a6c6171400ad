"""The defaults of a track, which `completed` fills in once.

All later steps get complete options.
"""

from typing import Any

from posefit.errors import InputError
from posefit.motion import built_in, recorded
from posefit.motion.clips import Source
from posefit.registry import registry
from posefit.silhouette.sharing import default_threads
from posefit.tracking.method import DEFAULT_PRIOR, method_names, offers_of
from posefit.tracking.options import EVALUATIONS, TrackOptions
from posefit.tracking.restarts import RESTARTS

DEFAULT_FOOTAGE_PRIOR = "loose"
DEFAULT_TRACKER = "exemplars"  # if it is installed
DEFAULT_TRACKER_EVALUATIONS = 9760  # per frame
BODY_FRAMES = 12  # the build is fitted to this many frames


def completed(options: TrackOptions, motion: Source | None) -> TrackOptions:
    """Return options with every default filled in.

    The default method is `exemplars`, with the library of recorded motions and its own
    default budget. The method is `annealed@pca` for a built-in motion, and for any
    source if an optimiser, a prior, or settings of other plugins are given. A given
    optimiser or prior replaces `annealed` or `pca`. For footage the default prior is
    `loose` instead of `pca`. Methods other than `exemplars` learn from the other styles
    of a built-in motion, or else from the built-in walks.

    Args:
        options: The options that the user chose.
        motion: The known motion that is tracked, or None for footage.

    Returns:
        The complete options.

    Raises:
        InputError: Options exclude each other.
    """
    footage = motion is None
    name = motion if isinstance(motion, str) and motion in built_in.names() else None
    method = _method(options, footage, name)
    by_default = method == DEFAULT_TRACKER
    styles = built_in.other_styles(name or "walk")
    body_frames = BODY_FRAMES if footage and options.asf is None else 0
    restarts = RESTARTS if footage and not offers_of(method)[0].looks_ahead else 0
    train = [recorded.LIBRARY] if by_default else styles
    evaluations = DEFAULT_TRACKER_EVALUATIONS if by_default else EVALUATIONS
    options = options.changed(
        method=method,
        train=options.train or train,
        evaluations=options.evaluations or evaluations,
        translation=options.translation or ("aligned" if footage else "known"),
        restarts=restarts if options.restarts is None else options.restarts,
        body_frames=body_frames if options.body_frames is None else options.body_frames,
        smooth=footage if options.smooth is None else options.smooth,
        threads=options.threads or default_threads(),
    )
    if options.smooth and options.translation == "known":
        raise InputError(
            "smooth needs a translation that is searched or aligned, got known"
        )
    return options


def _method(options: TrackOptions, footage: bool, built_in_name: str | None) -> Any:
    """Return the method of a track: a name with its prior, or what the user gave.

    Args:
        options: The options that the user chose.
        footage: Whether footage is tracked.
        built_in_name: The name of the built-in motion that is tracked, or None.
    """
    method = options.method
    offers = registry().offers
    # settings of other plugins than the default tracker choose another method
    plugins = {setting.partition(".")[0] for setting in options.settings}
    settings_fit = not plugins - {DEFAULT_TRACKER}
    installed = DEFAULT_TRACKER in offers["tracker"]
    if method is None and built_in_name is None and settings_fit and installed:
        return DEFAULT_TRACKER
    if method is not None and not isinstance(method, str):
        return method
    optimiser = next(iter(plugins & {*offers["optimiser"]}), "@")
    prior = DEFAULT_FOOTAGE_PRIOR if footage else DEFAULT_PRIOR
    return str(method_names(method or optimiser, prior))
