"""Which frames are lost, and does the tracker know? `posefit reproduce lost`.

design.py      which tracks there are: all clips of `people`, from all sides, under all conditions
experiment.py  follows them, fits the detector, and judges it on people whom it was not fitted to
model.py       the logistic model, and what it says of whom it has not seen
tables.py      shares and curves by group, view and condition, and how they are printed
"""
