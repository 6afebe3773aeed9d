"""Wire formats, one file each: bytes to readings. None needs a package beyond the core's."""
