"""How fast the loop is: `posefit bench`.

loop.py    all figures, from one run
kernel.py  the problem, the same costs drawn by OpenCV, timing, and the processor
"""
