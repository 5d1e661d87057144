"""Data that are computed once for a mesh, a material or a light and stored in the user's cache."""
