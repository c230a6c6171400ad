"""Masks, and the cost of a body's silhouette against a mask. SAPSO (3), (4).

| looking for | file |
|---|---|
| a mask with unknown pixels, as bit images, and at smaller sizes | mask.py |
| areas R, B, Y and the cost of poses; a body drawn as a mask | cost.py |
| work on thousands of poses shared by threads | sharing.py |
| the count of drawn poses | drawn.py |
| a body drawn into a bit image, compiled | rasteriser.py, outlines.py |
| instructions that the rasteriser needs and numba lacks | spans.py |
| pixels of bodies counted against silhouettes, compiled | kernels.py |
| a person separated from the background, pixel by pixel | foreground.py |
| which pieces of a mask are one person | pieces.py |
| faults of masks, simulated: holes, blobs, shadows | corruption.py |
"""
