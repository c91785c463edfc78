"""The chaos monkey: injects faults into a running arm, and records it from outside."""
