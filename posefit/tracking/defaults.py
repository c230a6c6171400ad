"""The defaults of a track: `completed` fills in what a user left open, once; below it, None stands for no default."""

from posefit.errors import InputError
from posefit.motion import built_in, recorded
from posefit.motion.clips import Source
from posefit.registry import registry
from posefit.tracking.method import DEFAULT_PRIOR, method_names, offers_of
from posefit.tracking.options import EVALUATIONS, TrackOptions
from posefit.tracking.restarts import RESTARTS

DEFAULT_FOOTAGE_PRIOR = "loose"
DEFAULT_TRACKER = "exemplars"  # where it is installed
DEFAULT_TRACKER_EVALUATIONS = 9760  # of a frame
BODY_FRAMES = 12  # to which a build is fitted


def completed(options: TrackOptions, motion: Source | None) -> TrackOptions:
    """Return options with every default filled in, by the known `motion` that is tracked, or None for footage.

    The method is `exemplars`, which learns from the library of recorded motions and has a budget of its own. A built-in
    motion, and all else for which an optimiser, a prior or settings of theirs are given, is tracked by `annealed@pca`,
    or the optimiser that settings name; footage with the prior `loose`. These and other trackers learn from the other
    styles of a built-in motion, or else from the built-in walks. Raises InputError for options that exclude each other.
    """
    footage = motion is None
    name = motion if isinstance(motion, str) and motion in built_in.names() else None
    method = options.method
    offers = registry().offers
    set_names = {setting.partition(".")[0] for setting in options.settings}
    if (
        method is None
        and name is None
        and not set_names - {DEFAULT_TRACKER}
        and DEFAULT_TRACKER in offers["tracker"]
    ):
        method = DEFAULT_TRACKER
    elif method is None or isinstance(method, str):
        optimiser = next(iter(set_names & {*offers["optimiser"]}), "@")
        method = str(
            method_names(
                method or optimiser, DEFAULT_FOOTAGE_PRIOR if footage else DEFAULT_PRIOR
            )
        )
    by_default = method == DEFAULT_TRACKER
    styles = built_in.other_styles(name or "walk")
    body_frames = BODY_FRAMES if footage and options.asf is None else 0
    restarts = RESTARTS if footage and not offers_of(method)[0].looks_ahead else 0
    options = options.changed(
        method=method,
        train=options.train or ([recorded.LIBRARY] if by_default else styles),
        evaluations=options.evaluations
        or (DEFAULT_TRACKER_EVALUATIONS if by_default else EVALUATIONS),
        translation=options.translation or ("aligned" if footage else "known"),
        restarts=restarts if options.restarts is None else options.restarts,
        body_frames=body_frames if options.body_frames is None else options.body_frames,
        smooth=footage if options.smooth is None else options.smooth,
    )
    if options.smooth and options.translation == "known":
        raise InputError(
            "smooth must be given where the translation is searched or aligned, got known"
        )
    return options
