"""posefit recovers a person's 3D motion from silhouettes, by searching.

    import posefit
    track = posefit.track("walk")           # or masks (T, H, W), a folder, a video; the same as `posefit track walk`
    print(track)                            # its errors, or signs of trust
    track.joints, track.angles("left_knee_flexion"), track.to_pandas(), track.show(), track.save("out")

`fit` takes one mask, `compare` runs a small sweep, `suite` numbers problems for a benchmark. The pieces: `Skeleton`,
`Body` and `Camera` describe the person and the view; `Silhouette` an observation; `SearchSpace` the box that optimisers
search; `PoseProblem` the cost; `minimise` the loop; `SynthesisTracker` follows a sequence. What the author of a plugin
imports is in `posefit.plugin`. Each name is imported when it is first used.
"""

import re
from importlib import import_module
from pathlib import Path
from typing import Any

from pluggy import HookimplMarker

from posefit.version import __version__ as __version__

hookimpl = HookimplMarker("posefit")

# the stub declares them once, for type checkers and for here: SPEC 1 of Scientific Python, lazy loading
_STUB = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_HOME = {name: home for home, name in re.findall(r"^from (posefit\.\S+) import (\w+)", _STUB, re.MULTILINE)}
__all__ = ["hookimpl", *_HOME]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        from posefit.reading import suggestion

        raise AttributeError(f"module 'posefit' has no attribute {name!r}{suggestion(name, __all__)}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
