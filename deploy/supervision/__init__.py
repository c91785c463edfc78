"""What keeps an arm alive: supervisord with its programs, and the sentinel, which replaces those that hang.

``supervisord.py`` starts and stops it, with ``extension.py`` (through ``plugin.py``) and warm forks
(``prefork.py``) in it. ``sentinel.py`` observes by ``probe.py`` and ``machine.py``, decides by
``policy.py`` and ``silence.py``, and acts by ``rpc.py``. ``system.py`` has the files and processes of a
system, ``manifest.py`` its programs, and ``reaction.py`` how soon its engines stop. ``recorder.py`` writes
its messages.
"""
