"""Drawing bodies as pictorial maps draw people: inks, fills, faces, things worn and held, backgrounds."""
