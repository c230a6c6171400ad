"""The areas of poses, counted on an NVIDIA GPU: the same loops as beside this folder, one block of threads a pose.

Nothing here but `device` is imported unless a silhouette lies on a device.

| looking for | file |
|---|---|
| whether a device is available; a silhouette on it | device.py |
| thousands of poses in parts, there and back; arrays that stay there | areas.py |
| one pose: the steps of its threads, compiled | launch.py |
"""
