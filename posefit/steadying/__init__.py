"""A track that was found frame by frame, as a body would walk it: no shaking, and feet that stay where they stand.

It knows motions and where a camera stands, and nothing of silhouettes.
"""
