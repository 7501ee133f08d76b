"""2D joints → 3D joints."""
