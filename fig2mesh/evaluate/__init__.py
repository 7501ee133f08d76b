"""Evaluation: convert folders of drawings and measure the models."""
