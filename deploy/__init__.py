"""How the system gets onto a machine, and how it stays up there."""
