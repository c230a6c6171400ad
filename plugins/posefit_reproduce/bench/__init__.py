"""How fast the loop is: `posefit bench`.

experiment.py    all figures, from one run
kernel.py        the problem, the same costs drawn by OpenCV, and timing
optimisers.py    ask and tell of every optimiser, in 9 dimensions and of ours in 28
environments.py  steps of environments
processor.py     which instructions the loops are compiled for
device.py        a GPU beside the CPU: `posefit bench --device cuda`
"""
