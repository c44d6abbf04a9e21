"""Changing homes: the next one is loaded while an episode runs, and nothing stays of those before."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import threading
import weakref
from types import SimpleNamespace

import gymnasium as gym
import pytest

from openmap_env.prefetch import Homes
from openmap_scenes import DataError
from openmap_scenes.catalog import READERS

SMALL = {"width": 32, "height": 24, "episodes_per_scene": 6}


def threads():
    return [thread for thread in threading.enumerate() if thread.name.startswith("openmap-next-home")]


class Loader:
    """Loads homes that are no more than a name; waits until it may, and notes who asked."""

    def __init__(self):
        self.may, self.calls, self.warmed = threading.Event(), [], []
        self.may.set()
        self.made = weakref.WeakSet()
        self.homes = Homes(self.load, lambda home: self.warmed.append(home.spec))

    def load(self, spec):
        here = threading.current_thread() is threading.main_thread()
        self.calls.append((spec, "here" if here else "ahead"))
        assert here or self.may.wait(10.0)
        if spec == "bad":
            raise DataError("bad", "nothing", "a home")
        home = Home(spec)
        self.made.add(home)
        return home


class Home(SimpleNamespace):
    def __init__(self, spec):
        super().__init__(spec=spec)

    __hash__ = object.__hash__


@pytest.fixture
def loader():
    loader = Loader()
    yield loader
    loader.may.set()
    loader.homes.close()
    assert threads() == []


def test_the_next_home_is_loaded_in_the_background(loader):
    assert loader.homes.enter("a").spec == "a"
    assert threads() == [], "no thread before anything is looked ahead to"
    loader.homes.look_ahead("b")
    loader.homes.look_ahead("b")
    assert loader.homes.enter("a").spec == "a"
    assert loader.homes.enter("b").spec == "b"
    assert loader.calls == [("a", "here"), ("b", "ahead")]
    assert loader.warmed == ["b"]


def test_what_is_not_wanted_any_more_is_let_go_of(loader):
    loader.homes.enter("a")
    loader.may.clear()
    loader.homes.look_ahead("b")
    loader.homes.look_ahead("c")
    assert loader.homes.enter("d").spec == "d", "nobody waits for what is not wanted"
    loader.may.set()
    loader.homes.look_ahead("e")
    assert loader.homes.enter("e").spec == "e"
    assert ("c", "ahead") not in loader.calls, "what had not begun never begins"
    gc.collect()
    assert {home.spec for home in loader.made} == {"e"}


def test_a_home_that_is_looked_at_twice_is_loaded_once(loader):
    assert loader.homes.get("a") is loader.homes.get("a")
    assert loader.homes.enter("a") is loader.homes.get("a")
    assert loader.calls == [("a", "here")]


def test_what_goes_wrong_ahead_is_said_where_it_is_needed(loader):
    loader.homes.enter("a")
    loader.homes.look_ahead("bad")
    assert loader.homes.enter("a").spec == "a", "and nowhere else"
    with pytest.raises(DataError, match="found nothing, expected a home"):
        loader.homes.enter("bad")
    with pytest.raises(DataError, match="found nothing"):
        loader.homes.enter("bad")
    assert loader.homes.enter("b").spec == "b"


def test_closing_waits_for_the_thread_and_all_can_begin_again(loader):
    loader.homes.enter("a")
    loader.homes.look_ahead("b")
    loader.homes.close()
    loader.homes.close()
    assert threads() == []
    gc.collect()
    assert len(loader.made) == 0
    assert loader.homes.enter("b").spec == "b"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
def test_a_fork_loads_for_itself():
    code = """if True:
        import os, types
        from openmap_env.prefetch import Homes
        homes = Homes(lambda spec: types.SimpleNamespace(spec=spec), lambda home: None)
        homes.enter("a")
        homes.look_ahead("b")
        child = os.fork()
        ahead = homes.enter("b").spec
        homes.look_ahead("c")
        assert (ahead, homes.enter("c").spec) == ("b", "c")
        homes.close()
        if child:
            raise SystemExit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
        os._exit(0)
    """
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert run.returncode == 0, run.stderr


@pytest.fixture
def counted(toy_scene):
    """Toy homes that note which of them was read, and in which thread; ``toy2:3`` cannot be read."""
    reads = []

    def read(rest):
        reads.append((rest, threading.current_thread() is threading.main_thread()))
        if rest == "3":
            raise DataError("toy2:3", "a ruin", "a home")
        return toy_scene

    READERS["toy2"] = read
    yield reads
    del READERS["toy2"]


def run(scenes, prefetch, steps=12):
    env = gym.make("OpenMapNav-v0", scene=scenes, prefetch=prefetch, protocol="navigation", **SMALL)
    told = [env.reset(seed=1)[1]] + [env.reset()[1] for _ in range(steps)]
    env.close()
    return told


def test_looking_ahead_changes_nothing_that_is_drawn(counted):
    scenes = ["toy2:0", "toy2:1", "toy2:2"]
    plain = run(scenes, prefetch=False)
    assert all(here for _, here in counted)
    counted.clear()
    assert run(scenes, prefetch=True) == plain
    assert [here for _, here in counted].count(True) == 1, "only the first home is waited for"
    assert threads() == []


def test_an_environment_in_one_home_has_no_thread(counted):
    env = gym.make("OpenMapNav-v0", scene="toy2:0", **SMALL)
    env.reset(seed=0)
    env.reset()
    assert threads() == []
    assert counted == [("0", True)]
    env.close()


def test_a_home_that_cannot_be_read_is_told_of_when_its_turn_comes(counted):
    env = gym.make("OpenMapNav-v0", scene=["toy2:0", "toy2:3"], **SMALL)
    env.reset(seed=0, options={"scene": "toy2:0"})

    def walk_on():
        for _ in range(20):
            env.reset()

    with pytest.raises(DataError, match="toy2:3: found a ruin"):
        walk_on()
    assert ("3", False) in counted
    env.reset(options={"scene": "toy2:0"})
    assert not env.step(1)[2]
    env.close()
    assert threads() == []


def test_another_home_by_name_takes_the_place_of_the_one_looked_ahead_to(counted):
    env = gym.make("OpenMapNav-v0", scene=["toy2:0", "toy2:1"], **SMALL)
    env.reset(seed=0)
    for spec in ("toy2:2", "toy2:1", "toy2:2", "toy2:0"):
        env.reset(options={"scene": spec})
        assert env.unwrapped.episode.scene == spec
    simulator = env.unwrapped.simulator
    env.reset(options={"scene": "toy2:0"})
    assert env.unwrapped.simulator is simulator, "the same home again: nothing is loaded"
    env.close()
