"""PLY and OBJ as they are read back: by trimesh, after their size and the files they name have been looked at."""
