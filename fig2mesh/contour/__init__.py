"""Contour of a drawing: its line along the rim of the figure, taken off the surface and made a mesh of its own."""
