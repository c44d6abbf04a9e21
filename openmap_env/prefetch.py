"""Homes in memory: the one at hand, and the next one, which is loaded in the background while an episode runs.

At most these two are held. The thread begins with the first home that is looked ahead to, never before, so that an environment
may be forked until its first reset.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

from openmap_env.navigation import NavigableSurface
from openmap_scenes import Scene


@dataclass(frozen=True)
class Home:
    """A scene that was loaded, and where a body can stand in it.

    Parameters
    ----------
    spec : str
        Of the catalogue.
    scene : Scene
    surface : NavigableSurface
    """

    spec: str
    scene: Scene
    surface: NavigableSurface


class Homes:
    """Loads homes by spec.

    Parameters
    ----------
    load : callable
        Spec -> Home. It is called in a thread of its own for what is looked ahead to, and in the caller's for all else.
    warm : callable
        What that thread does with a home besides, so that nobody has to wait for it later.
    """

    def __init__(self, load: Callable[[str], Home], warm: Callable[[Home], None]) -> None:
        self._load, self._warm = load, warm
        self._at_hand: Home | None = None
        self._next: tuple[str, Future[Home]] | None = None
        self._thread: ThreadPoolExecutor | None = None
        self._process = os.getpid()

    def enter(self, spec: str) -> Home:
        """The home of a spec, which is at hand from now on; the one before is let go of."""
        home = self.get(spec)
        if home is not self._at_hand:
            self._at_hand, self._next = home, None
        return home

    def get(self, spec: str) -> Home:
        """The home of a spec: at hand, or looked ahead to, or else loaded now.

        What goes wrong in the background is raised here, as if it were loaded now.
        """
        if self._at_hand is not None and self._at_hand.spec == spec:
            return self._at_hand
        self._notice_fork()
        if self._next is not None and self._next[0] == spec:
            try:
                return self._next[1].result()
            except BaseException:
                self._next = None
                raise
        self.look_ahead(None)
        found: Future[Home] = Future()
        found.set_result(self._load(spec))
        self._next = (spec, found)
        return found.result()

    def look_ahead(self, spec: str | None) -> None:
        """Begin to load a home in the background, in place of one that was begun before; None, or the one at hand = none.

        Python cannot stop a thread: what was begun and is not wanted any more runs to its end, and only then the next.
        """
        self._notice_fork()
        if spec is None or (self._at_hand is not None and self._at_hand.spec == spec):
            if self._next is not None:
                self._next[1].cancel()
                self._next = None
        elif self._next is None or self._next[0] != spec:
            if self._next is not None:
                self._next[1].cancel()
            if self._thread is None:
                self._thread = ThreadPoolExecutor(1, "openmap-next-home")
            self._next = (spec, self._thread.submit(self._load_ahead, spec))

    def close(self) -> None:
        """Let go of everything and wait for the thread to end; again is harmless."""
        self._notice_fork()
        thread = self._thread
        self._at_hand = self._next = self._thread = None
        if thread is not None:
            thread.shutdown(wait=True, cancel_futures=True)

    def _load_ahead(self, spec: str) -> Home:
        home = self._load(spec)
        self._warm(home)
        return home

    def _notice_fork(self) -> None:
        if self._process != os.getpid():  # of all threads, only the one that forked is here
            self._next = self._thread = None
            self._process = os.getpid()
