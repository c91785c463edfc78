"""One file per alternative: how a process of the benchmark sends and receives with it."""
