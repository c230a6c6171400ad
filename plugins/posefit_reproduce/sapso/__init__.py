"""The SAPSO paper's experiments: Acta Automatica Sinica 38(5), 2012, section 5. `posefit reproduce sapso`.

numbers.py      the paper's own tables
motions.py      a walk, a walk with a turn and a run: CMU's clips, or built in
design.py       the methods that are compared, and how much is run
experiment.py   the tracks, the first frames and the baselines
first_frame.py  the compact space, and the swarm of one search in it
claims.py       what the paper claims, and whether the experiments confirm it
report.py       tables 1 and 2, what was shortened, and the printed text
figures.py      figures 3 to 7 and 9
"""
