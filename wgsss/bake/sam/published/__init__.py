"""Choice of senders as published (Maisch & Ropinski 2017): the largest form factors of the mesh or of a coarse one."""
