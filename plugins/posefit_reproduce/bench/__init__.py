"""How fast the loop is: `posefit bench`.

experiment.py    all figures, from one run
kernel.py        the problem, the same costs drawn by OpenCV, timing, and the processor
optimisers.py    ask and tell of every optimiser, in 9 dimensions and of ours in 28
environments.py  steps of environments
device.py        a GPU beside the CPU: `posefit bench --device cuda`
"""
