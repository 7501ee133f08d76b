"""Correcting by hand what was found in a drawing: joints, silhouette, parts, which limbs are in front."""
