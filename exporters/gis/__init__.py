"""Indexes and catalogues for GIS clients: CZML, GeoJSON, GeoPackage and STAC, with their checks and facts."""
