"""Readers of untrusted files with explicit limits. In the lowest package, since all three packages read such files."""
