"""What the silhouette of one frame leaves open: see `estimate` and, for tables and pictures, `output`."""
