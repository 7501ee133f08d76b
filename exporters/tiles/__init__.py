"""3D Tiles: tilesets of one figure, trees over many, their checks and facts."""
