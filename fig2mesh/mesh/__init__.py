"""From the body's distance field to a closed, simplified, unwrapped mesh (paper §4.5)."""
