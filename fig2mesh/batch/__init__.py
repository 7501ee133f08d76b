"""Batch conversion of collections: many figures, one row of a table each."""
