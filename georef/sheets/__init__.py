"""Georeferenced map sheets: their files, the transformations fitted to control points, reference systems."""
