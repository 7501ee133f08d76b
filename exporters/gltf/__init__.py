"""glTF 2.0: writing, reading, checking and inspecting GLB and glTF files."""
