"""What accuracy costs: every knob of the main job swept on a figure, error against seconds and memory."""
