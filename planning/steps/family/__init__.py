"""One rig for several meshes."""
