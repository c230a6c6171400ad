"""Weighted poses: which are possible, how likely each is, and how far off each joint may be.

A silhouette seldom determines one pose. What it leaves open is a `Posterior`: weighted poses of one frame.

    from posefit.uncertainty.intervals import joint_intervals
    from posefit.uncertainty.modes import modes_of

    for mode in modes_of(skeleton, posterior):             # the likeliest first
        print(mode.weight, mode.pose[0])
    radii = joint_intervals(skeleton, posterior, pose)     # metres about the joints of a pose (66,)
    print(radii[1])                                        # that hold each joint in 80 of 100 cases

| subject | field's term | file |
|---|---|---|
| weighted poses, clustered by their joints; exchanged sides | modes, clustering, mirror ambiguity | modes.py |
| errors of joints and angles | credible intervals, of a mixture | intervals.py |
| errors that all frames of footage share | systematic error | shared.py |
| calibrated probabilities and intervals | conformal prediction, coverage, ECE | calibration.py |
"""
