"""Supervision: the manifest, the running system, its processes, and the sentinel."""
