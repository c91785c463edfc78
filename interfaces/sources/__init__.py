"""Virtual sources: services that play a scenario. Other services do not import this package.

``scenario_file.py`` reads a scenario, ``timeline.py`` has its values over time, and ``player.py`` plays
them from the epoch on, or by the time of the drive (``driving.py``). What a user sets by hand takes the
place of the scenario and survives a restart (``settings.py``, ``settings_file.py``).
"""
