"""The person and the camera.

| looking for | file |
|---|---|
| 27 joints, 26 bones, 66 angles and limbs; the joints of a pose | skeleton.py |
| body shape: one tapered cone per bone | body.py |
| root and joint angles as rotations. Interpretation S3 | rotation.py |
| poses with nearly the same silhouette, such as mirrored ones | symmetry.py |
| a pinhole camera | camera.py |
| units of length | units.py |
| calibration files, one reader per program; lens distortion | calibration/ |
| forward kinematics, compiled | kernels.py |

World: y up, metres. Camera: x right, y down, z forward. Names chain:
`points_camera = camera_from_world @ points_world`.
A joint is the end of the bone with the same name: `lfemur` is the left knee.
"""
