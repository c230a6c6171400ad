"""posefit recovers a person's 3D motion from silhouettes, by searching.

    import posefit
    track = posefit.track("walk")  # or masks (T, H, W), a folder, a video
    print(track)  # its errors, or signs of trust
    track.joints, track.angles("left_knee_flexion"), track.to_pandas()
    track.show()
    track.save("out")

`posefit track walk` does the same on the command line. `fit` takes one mask, `compare`
runs a small sweep, `suite` numbers problems for a benchmark.

These are the parts: `Skeleton`, `Body` and `Camera` describe the person and the view,
and `Silhouette` is an observation. `SearchSpace` is the box that optimisers search, and
`SilhouetteCost` is the cost of a proposal. `Problem` counts the evaluations and
remembers the best, and `minimise` is the loop. `SynthesisTracker` follows a sequence.

`posefit.plugin` has what plugin authors import. Each name is imported when it is first
used.
"""

from pluggy import HookimplMarker

from posefit.lazy import names_of_stub
from posefit.version import __version__ as __version__

hookimpl = HookimplMarker("posefit")
__getattr__, __dir__, _names = names_of_stub(__name__, __file__)
__all__ = ["hookimpl", *_names]
