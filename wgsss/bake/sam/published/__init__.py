"""The selections that the paper describes (Maisch & Ropinski 2017): the senders of largest form factor.

`top` chooses them among the vertices of the mesh, `coarse` among those of a simplified mesh.
"""
