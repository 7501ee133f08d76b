"""Evaluation: convert drawings, or synthetic figures with known backs, and measure the models."""
