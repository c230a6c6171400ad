"""A track that was found frame by frame, as a body would walk it: no shaking, and feet that stay where they stand.

- `path` is the likeliest way of a root and two legs, of a motion alone: `stance` says which foot stands, and `squares`
  solves for all frames at once.
- `outlines` fits poses, way and build to where the borders of the masks are: `borders` says where that is, `shown` what
  the border of a drawn body hangs on, and `kernels` brings both together.
- `frames` does both to what a tracker found, and `passes` follows once more where that went.
"""
