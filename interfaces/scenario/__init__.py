"""Scenarios: what the virtual sources do, and when."""

from interfaces.scenario.scenario import Events, Scenario, ScenarioError, Sweep, Timeline, follow, load, play

__all__ = ["Events", "Scenario", "ScenarioError", "Sweep", "Timeline", "follow", "load", "play"]
