"""posefit's suite for COCO's post-processing, which knows only its own suites.

Example:
    >>> from posefit_bridges.coco import add_to_cocopp
    >>> add_to_cocopp()  # doctest: +SKIP
    >>> import cocopp  # doctest: +SKIP
    >>> cocopp.main("coco/cma coco/pso")  # doctest: +SKIP
"""

import math
from typing import Any

import numpy as np

from posefit.motion.instances import HELD_OUT
from posefit.suites.functions import ANGLES, DIMENSIONS, FUNCTIONS, SUITE
from posefit.suites.problem import TARGETS
from posefit.suites.registry import STANDARD_INSTANCES

# COCO's figures show six dimensions at most, and compare two of these in detail
SHOWN_DIMENSIONS = DIMENSIONS[:-1]
COMPARED_DIMENSIONS = (9, 20)
# cocopp keeps the evaluations until each cost 10^(k / POINTS), with whole numbers k.
# The suite's targets are of that form, because they are powers of the fourth root of 2.
POINTS = 4.0 / math.log10(2.0)


def add_to_cocopp() -> None:
    """Tell cocopp the names, dimensions and targets of posefit's suite.

    Without it, cocopp refuses the files that `posefit report --coco` writes.

    Raises:
        ImportError: cocopp is not installed.
    """
    from cocopp import genericsettings, testbedsettings

    # computed as cocopp does, to the last bit
    targets = 10.0 ** (np.rint(POINTS * np.log10(TARGETS)) / POINTS)
    least = float(targets[-1])
    each_octave = targets[4::4]  # 16, 8, 4, 2, 1, 0.5, 0.25
    few = targets[4::8]  # 16, 4, 1, 0.25
    settings = {
        "name": SUITE,
        "short_names": {function.number: function.name for function in FUNCTIONS},
        "first_function_number": FUNCTIONS[0].number,
        "last_function_number": FUNCTIONS[-1].number,
        "functions_with_legend": (FUNCTIONS[0].number, FUNCTIONS[-1].number),
        "dimensions_to_display": SHOWN_DIMENSIONS,
        "goto_dimension": ANGLES[0],
        "rldDimsOfInterest": COMPARED_DIMENSIONS,
        "tabDimsOfInterest": COMPARED_DIMENSIONS,
        "hardesttargetlatex": f"{least:g}",
        "ppfigs_ftarget": least,
        "ppfig2_ftarget": least,
        "pptable_ftarget": least,
        "ppfvdistr_min_target": least,
        "ppfigdim_target_values": tuple(each_octave),
        "pptable_targetsOfInterest": tuple(each_octave),
        "pptablemany_targetsOfInterest": tuple(each_octave),
        "pprldistr_target_values": tuple(few),
        "rldValsOfInterest": tuple(few),
        "pprldmany_target_values": targets,
        "pprldmany_target_range_latex": f"{least:g} to {targets[0]:g}",
        "ppscatter_target_values": targets,
        "number_of_points": POINTS,
        "reference_algorithm_filename": "",
        "reference_algorithm_displayname": "",
        "flex_navigation_json_file": "",
        "plots_on_main_html_page": [
            f"pprldmany_{dimension:02d}D_noiselessall.svg"
            for dimension in SHOWN_DIMENSIONS
        ],
    }

    class PosefitTestbed(testbedsettings.GECCOBBOBTestbed):
        """The functions of posefit's suite."""

        def __init__(self, target_values: Any) -> None:
            super().__init__(target_values)
            for name, value in settings.items():
                setattr(self, name, value)
            self.instantiate_attributes(target_values)

        def info(self, fun_number: int | None = None) -> str | None:
            """Return a function's number and name, or the suite's description."""
            if fun_number is None:
                return self.__doc__
            return f"F{fun_number} {self.short_names[fun_number]}"

        def filter(self, dsl: Any) -> Any:
            """Return the unchanged data, which are not joined with other suites."""
            return dsl

    standard = dict.fromkeys(HELD_OUT[:STANDARD_INSTANCES], 1)
    if standard not in genericsettings.instancesOfInterest:
        genericsettings.instancesOfInterest.append(standard)
    # cocopp looks for a testbed by its class's name in its module
    testbedsettings.PosefitTestbed = PosefitTestbed
    testbedsettings.suite_to_testbed[SUITE] = PosefitTestbed.__name__
