"""Silhouette and joints → part fields → one body."""
