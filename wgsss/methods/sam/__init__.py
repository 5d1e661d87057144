"""M_back by Spatial Adjacency Maps (Maisch & Ropinski 2017): upload of baked maps, deforming meshes, and the passes."""
