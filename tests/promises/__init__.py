"""The judge: the history of an arm, the checkers of its promises, and their reports.

A record becomes a history (``observations.py``, ``history.py``); ``effects.py`` says once what each fault may
do to which program.
The checkers (``safety.py``, ``drive.py``, ``liveness.py``) make findings of both, and excuse only what an
effect explains. ``text_report.py`` and ``html_report.py`` show the verdict. Imports go one way;
import-linter checks it.
"""
