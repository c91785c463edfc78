"""Virtual sources: services that play a scenario. Other services do not import this package."""
