"""Errors that a service reports in one line."""

from __future__ import annotations


class UserError(Exception):
    """An error in what the user gave a service: the service reports it in one line and exits with 2."""
