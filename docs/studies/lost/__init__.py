"""Which frames are lost, in which are left and right swapped, and does the tracker know? `posefit reproduce lost`.

design.py      which tracks there are: clips of many motions, from all sides, with clean and with real masks
damage.py      silhouettes as a camera's masks are
experiment.py  follows them, fits the models, and judges them on people whom they were not fitted to
model.py       the logistic models, and what they say of whom they have not seen
tables.py      shares and curves by group, number of views and condition, and how they are printed
"""
