"""Evaluation of the main job: whole folders of drawings converted, what comes out measured."""
