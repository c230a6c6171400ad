"""The speed of the search loop: `posefit bench`.

loop.py    all figures, from one run
kernel.py  the problem, the same costs with OpenCV, timing, and the processor
"""
