"""Masks, and what a body's silhouette costs against one. SAPSO (3), (4).

| looking for | file |
|---|---|
| a mask, its unknown pixels, both as bits, and at half or quarter size | mask.py |
| areas R, B, Y and the cost of poses; a body drawn as a mask | cost.py |
| thousands of poses in parts, shared by threads; how many were drawn | sharing.py, drawn.py |
| a body drawn as spans of bits, compiled | rasteriser.py |
| its pixels counted against silhouettes, and what it leaves of them, compiled | kernels.py |
| a person separated from a background, pixel by pixel | foreground.py |
| which pieces of a mask are one person | pieces.py |
| what goes wrong with a mask on its way from a camera, made on purpose | corruption.py |
"""
