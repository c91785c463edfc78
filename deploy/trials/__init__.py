"""Trials of the promises: chaos with real processes, simulation in virtual time, replay of records."""
