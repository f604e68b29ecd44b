"""Import of meshes, maps and height models: bounded reading, repair, conversion to scenes."""
