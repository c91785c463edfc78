"""What keeps the services alive: the running system, its processes, and the sentinel."""
