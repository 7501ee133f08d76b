"""Measures of quality of models and of their front views."""
