"""The terminal: a prompt or plain lines."""
