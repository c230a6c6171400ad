"""Measures a `Motion` in the terms and units of biomechanics, with plain functions.

| looking for | file |
|---|---|
| anatomical names of the 27 joints; centres of the large joints | centres.py |
| the axes of the segments | segments.py |
| clinical angles of hip, knee, ankle, shoulder and elbow, in degrees | angles.py |
| when feet strike and lift off | events.py |
| cadence, step, stride, speed, stance; is it a walk, or backwards? | gait.py |
| tables, and files for other programs | tables.py, c3d.py |

    from posefit.measuring.angles import clinical_angles
    from posefit.measuring.gait import gait_of
    from posefit.motion import recorded

    walk = recorded.clip("16_15").motion()
    print(clinical_angles(walk.skeleton, walk.poses)["left_knee_flexion"].max())
    print(gait_of(walk).cadence)
"""
