"""Spatial Adjacency Maps (Maisch & Ropinski 2017) as a method: upload, deformation, sum."""
