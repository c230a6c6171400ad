"""The SAPSO paper's experiments: Acta Automatica Sinica 38(5), 2012, section 5. `posefit reproduce sapso`.

numbers.py      the paper's own tables
motions.py      a walk, a walk with a turn and a run: CMU's clips, or built in
design.py       the methods that are compared, and how much is run
experiment.py   the tracks, the first frames and the baselines, in processes of the sweep engine
results.py      what they found
first_frame.py  the compact space, and one search in it, watched
claims.py       what the paper claims, and whether that is borne out
report.py       tables 1 and 2, and what was shortened
text.py         the same, as it is printed
figures.py      figures 3 to 7 and 9
"""
