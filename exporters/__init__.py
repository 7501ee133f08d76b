"""Writers for placed, textured figures: glTF, 3D Tiles, USD, PLY, OBJ. Needs no neural network."""
