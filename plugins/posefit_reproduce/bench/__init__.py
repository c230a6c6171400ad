"""How fast the loop is: `posefit bench`, `posefit bench --json`.

    experiment.py    all figures, from one run
    kernel.py        the problem, and the same costs drawn by OpenCV
    optimisers.py    ask and tell of every optimiser, in 9 dimensions and of ours in 28


    environments.py  steps of environments
    many.py          thousands of poses, several silhouettes, limbs, half and quarter size

    processor.py     which instructions the loops are compiled for
    device.py        a GPU beside the CPU: `posefit bench --device cuda`
    timing.py        jobs take turns, and the fastest run of each counts

Nothing here runs beside anything else, so nothing is given to the sweep engine.
"""
