"""The networks, one a file; torch is imported here and in `fig2mesh.training` when they are used, never before."""
