"""What the services share: the contract, reactive nodes, time, and the life of a process."""
