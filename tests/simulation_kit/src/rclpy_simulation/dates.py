"""``datetime`` of simulated programs: now is the time of day of their host."""

from __future__ import annotations

import datetime
import time
from typing import Any

_real, _real_date = datetime.datetime, datetime.date


class _Instances(type):
    """Lets all dates be instances: none has these types themselves."""

    _of: type

    def __instancecheck__(cls, instance: Any) -> bool:
        return isinstance(instance, cls._of)

    def __subclasscheck__(cls, kind: type) -> bool:
        return issubclass(kind, cls._of)


class _DateTime(_real, metaclass=_Instances):
    """``datetime.datetime``, but :meth:`now` and others read the clock through :mod:`time`."""

    _of = _real

    def __new__(cls, *arguments: Any, **options: Any) -> Any:
        return _real.__new__(_real if cls is _DateTime else cls, *arguments, **options)

    @classmethod
    def now(cls, tz: datetime.tzinfo | None = None) -> Any:
        return (_real if cls is _DateTime else cls).fromtimestamp(time.time(), tz)

    @classmethod
    def today(cls) -> Any:
        return cls.now()

    @classmethod
    def utcnow(cls) -> Any:
        return cls.now(datetime.UTC).replace(tzinfo=None)


class _Date(_real_date, metaclass=_Instances):
    _of = _real_date

    def __new__(cls, *arguments: Any, **options: Any) -> Any:
        return _real_date.__new__(_real_date if cls is _Date else cls, *arguments, **options)

    @classmethod
    def today(cls) -> Any:
        return (_real_date if cls is _Date else cls).fromtimestamp(time.time())


def replacements() -> list[tuple[Any, str, Any]]:
    return [(datetime, "datetime", _DateTime), (datetime, "date", _Date)]
