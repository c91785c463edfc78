"""Errors that are printed without a traceback."""

from __future__ import annotations


class DeploymentError(Exception):
    """Why the system cannot be started, stopped or asked; one line for the user."""
