"""From one drawn human figure on a pictorial map to a closed, textured, georeferenced 3D model."""

__version__ = "0.1.0"
