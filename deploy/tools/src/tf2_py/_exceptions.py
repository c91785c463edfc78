"""Errors of transforms."""


class TransformException(Exception):
    """Base of all errors of transforms."""


class ConnectivityException(TransformException):
    """No chain of transforms connects the frames."""


class LookupException(TransformException):
    """A frame does not exist, or the frames form a loop."""


class ExtrapolationException(TransformException):
    """The buffer has no transform at the requested time, nor one before and one after it."""


class InvalidArgumentException(TransformException):
    """An argument is not valid, for example an empty frame ID."""


class TimeoutException(TransformException):
    """A transform did not become available in time."""
