"""The terminal, with a prompt or plain lines."""
