"""What is computed once for a mesh and kept in the user's cache: its unwrap, the maps of its charts, …"""
