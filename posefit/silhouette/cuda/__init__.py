"""The areas of poses, counted on an NVIDIA GPU: the same loops as beside this folder, one block of threads a pose.

Nothing here is imported unless a silhouette lies on a device.

| looking for | file |
|---|---|
| whether a device is available | device.py |
| a silhouette on a device | moving.py |
| arrays that a device is given once: bodies, cameras, silhouettes | held.py |
| thousands of poses in parts, there and back | counted.py |
| one pose: what its threads do, one after the other | launch.py |
| forward kinematics | kinematics.py |
| cones, and where a row of pixels crosses them | cones.py |
| operations that are one instruction on a device | arithmetic.py |
"""
