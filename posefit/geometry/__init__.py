"""The person and the camera: skeletons, bodies of tapered cones, rotations, cameras and their calibrations.

| looking for | file |
|---|---|
| 27 joints, 26 bones, 66 angles, limbs, and where the joints of a pose are | skeleton.py |
| cones around the bones, and builds | body.py |
| root and joint angles as rotations. Interpretation S3 | rotation.py |
| poses with nearly the same silhouette: mirrored, turned, reflected, limbs exchanged | symmetry.py |
| a pinhole camera | camera.py |
| calibration files, a reader a program; lens distortion | calibration/ |
| forward kinematics, compiled | kernels.py |

World: y up, metres. Camera: x right, y down, z forward. Names chain:
`points_camera = camera_from_world @ points_world`.
A joint is the end of the bone of its name: `lfemur` is the left knee.
"""
