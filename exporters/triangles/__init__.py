"""Reading of PLY and OBJ by trimesh, after checks of their size and of referenced files."""
