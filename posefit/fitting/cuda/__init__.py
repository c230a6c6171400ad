"""Proposals decoded on an NVIDIA GPU, where poses are drawn: only proposals go there, and only areas come back.

Nothing here is imported unless a problem's silhouettes lie on a device.

| looking for | file |
|---|---|
| poses of proposals, a thread an angle | decoding.py |
| the areas of proposals in every view | evaluating.py |
"""
