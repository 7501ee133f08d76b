"""Neural networks, one per file; torch is imported here and in `fig2mesh.training` on first use, never before."""
