"""Records of a running arm."""
