"""The services: one reactive recipe and one process each."""
