"""Mutation testing of the safety path: each small change of the code must fail a test.

``mutations.py`` makes the changes, ``guards.py`` names the tests of each module, and ``checkout.py`` runs
them in a copy of the checkout by ``runner.py``, which forks for each change. ``equivalent.toml`` has the
changes that no test can notice, with reasons.
"""
