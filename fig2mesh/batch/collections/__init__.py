"""Readers of collections: rows of CSV, GeoJSON and GeoPackage files."""
