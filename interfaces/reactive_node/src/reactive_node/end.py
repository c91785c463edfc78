"""The end of a node, with which its observables complete."""

from __future__ import annotations

from typing import TypeVar

import reactivex as rx
from reactivex import Observable
from reactivex.subject import AsyncSubject

_T = TypeVar("_T")


class End(AsyncSubject[None]):
    """Emits ``None`` and completes when the node ends, or at once after that."""

    def limit(self, source: Observable[_T]) -> Observable[_T]:
        """Complete ``source`` with the node; after that, complete without a subscription to ``source``."""
        return rx.defer(lambda _: rx.never() if self.is_stopped else source).take_until(self)

    def come(self) -> None:
        """Complete all observers, even if some of them raise; the first of their errors is raised then."""
        with self.lock:
            observers, self.observers = self.observers, []
            self.on_next(None)
            self.on_completed()
        errors: list[Exception] = []
        for observer in observers:
            try:
                observer.on_next(None)
                observer.on_completed()
            except Exception as error:
                errors.append(error)
        if errors:
            raise errors[0]
