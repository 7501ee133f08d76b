"""Reading files from strangers within stated limits. At the bottom, since all three packages read such files."""
