"""Shared by the services: the contract, reactive nodes, the service framework, scenarios."""
