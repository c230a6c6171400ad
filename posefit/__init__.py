"""posefit recovers a person's 3D motion from silhouettes, by searching.

    import posefit
    track = posefit.track("walk")           # or masks (T, H, W), a folder, a video; the same as `posefit track walk`
    print(track)                            # its errors, or signs of trust
    track.joints, track.angles("left_knee_flexion"), track.to_pandas(), track.show(), track.save("out")

`fit` takes one mask, `compare` runs a small sweep, `suite` numbers problems for a benchmark. The pieces: `Skeleton`,
`Body` and `Camera` describe the person and the view; `Silhouette` an observation; `SearchSpace` the box that optimisers
search; `SilhouetteCost` what a proposal costs; `Problem` counts the evaluations and remembers the best; `minimise` is
the loop; `SynthesisTracker` follows a sequence. What the author of a plugin imports is in `posefit.plugin`. Each name
is imported when it is first used.
"""

from pluggy import HookimplMarker

from posefit.lazy import names_of_stub
from posefit.version import __version__ as __version__

hookimpl = HookimplMarker("posefit")
__getattr__, __dir__, _names = names_of_stub(__name__, __file__)
__all__ = ["hookimpl", *_names]
