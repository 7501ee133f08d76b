"""Picture → figure: pixels, silhouette, joints and part labels, from the user's files."""
