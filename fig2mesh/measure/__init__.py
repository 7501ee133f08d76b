"""Measures of results: how good a model or its front view is."""
