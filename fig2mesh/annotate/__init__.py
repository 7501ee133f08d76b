"""Manual annotation of a drawing: joints, silhouette, part labels, depth order of limbs."""
