"""From a mask to joints in the image: outline and skeleton line, the rules that find 17 points, and what is shown.

`preprocess.lines_of` is VSMM step 1; `joints.detected` is step 2, whose hidden joints `shown.Shown` predicts (2.7).
"""
