"""The commands behind `make`; each can be run without make, too.

``setup.py`` and ``stop.py`` need the standard library only. ``launcher.py`` has all that start an arm or
attach to it. ``parameters.py``, ``hosts.py`` and ``keystore.py`` refuse a wrong start in one line.
``fleet.py`` watches many arms. ``tables.py``, ``stubs.py`` and ``new_service.py`` write files for
developers.
"""
