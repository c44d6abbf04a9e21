"""Renderers side by side, one after another, and for long: none disturbs another, none leaves memory behind."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import numpy as np
import psutil
import pytest
from rendering_cases import (
    CAMERA,
    Make,
    cluttered_room,
    every_backend,
    frames,
    indoor_poses,
    needs_egl,
    needs_osmesa,
    open_backend,
)


@needs_osmesa
def test_renderers_live_side_by_side_and_outlive_each_other(make: Make) -> None:
    scenes = [cluttered_room(seed) for seed in (4, 5)]
    poses = indoor_poses(scenes[0], 3, 4)
    kinds = [("opengl", {}), ("pyrender", {}), ("opengl", {"platform": "osmesa"}), ("raycast", {}), ("pyrender", {})]
    alone = []
    for i, (name, extra) in enumerate(kinds):
        renderer = make(name, scenes[i % 2], CAMERA, **extra)
        alone.append(frames(renderer, poses))
        renderer.close()
    together = [make(name, scenes[i % 2], CAMERA, **extra) for i, (name, extra) in enumerate(kinds)]
    for k, T in enumerate(poses):
        for i, renderer in enumerate(together):
            if k == 2 and i == 0:
                together[1].close()
            if k == 2 and i == 1:
                continue
            np.testing.assert_array_equal(renderer.render(T).rgb, alone[i][k].rgb)
            np.testing.assert_array_equal(renderer.render(T).instance, alone[i][k].instance)


@needs_osmesa
@pytest.mark.parametrize("order", ["opengl pyrender", "pyrender opengl"])
def test_backends_load_in_either_order_in_a_fresh_process(order: str) -> None:
    script = f"""
        import numpy as np
        from openmap_env.rendering import make_renderer
        from openmap_scenes import Instance, Material, PinholeCamera, Scene
        corners = np.array([[-9, -9, -2], [9, -9, -2], [0, 20, -2]], np.float32)
        one, box = np.zeros(1, np.int32), (corners.mean(0), corners.min(0), corners.max(0))
        scene = Scene("one", corners, np.array([[0, 1, 2]], np.int32), one, one + 6,
                      [Material("grey", np.full(3, 0.5, np.float32))], [Instance(6, "thing", *box)])
        for name in "{order} {order}".split():
            renderer = make_renderer(name, scene, PinholeCamera(32, 24, 20, 20, 15.5, 11.5))
            frame = renderer.render(np.eye(4))
            assert (frame.instance == 6).all() and (frame.rgb == 128).all() and abs(frame.depth - 2).max() < 1e-3, name
        print("left open, closed by the end of the process")
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr


@every_backend
def test_three_hundred_frames_take_no_memory(make: Make, backend: str) -> None:
    scene = cluttered_room(6)
    poses = indoor_poses(scene, 10, 6)
    renderer = make(backend, scene, CAMERA)
    growth = _growth_mb(lambda i: renderer.render(poses[i % 10]), warm_up=60, repeats=300)
    assert growth < 5.0


@every_backend
def test_opening_and_closing_takes_no_memory(backend: str) -> None:
    scene = cluttered_room(7)

    def once(_: int) -> None:
        renderer = open_backend(backend, scene, CAMERA)
        renderer.render(np.eye(4))
        renderer.close()

    assert _growth_mb(once, warm_up=4, repeats=8) < 8.0


def _growth_mb(work: Callable[[int], object], warm_up: int, repeats: int) -> float:
    """Growth of resident memory, MB, over repeats of some work after a warm-up."""
    process = psutil.Process()
    for i in range(warm_up):
        work(i)
    gc.collect()
    before = process.memory_info().rss
    for i in range(repeats):
        work(i)
    gc.collect()
    return float(process.memory_info().rss - before) / 1e6


@pytest.mark.parametrize("platform", [pytest.param("egl", marks=needs_egl), pytest.param("osmesa", marks=needs_osmesa)])
def test_pyrender_runs_on_either_platform_beside_the_others(platform: str) -> None:
    script = f"""
        import numpy as np
        from rendering_cases import CAMERA, assert_same_as_reference, cluttered_room, frames, indoor_poses
        from openmap_env.rendering import RendererUnavailableError, make_renderer
        scene = cluttered_room(0)
        poses = indoor_poses(scene, 6, 0)
        others = [make_renderer("opengl", scene, CAMERA, platform=p) for p in ("egl", "osmesa")]
        pyrender = make_renderer("pyrender", scene, CAMERA, platform="{platform}")
        assert pyrender.platform == make_renderer("pyrender", scene, CAMERA).platform == "{platform}"
        reference = frames(make_renderer("raycast", scene, CAMERA), poses)
        for renderer in (pyrender, *others, pyrender):
            assert_same_as_reference(frames(renderer, poses), reference, rgb_tolerance=2.0)
        other = {{"egl": "osmesa", "osmesa": "egl"}}["{platform}"]
        try:
            make_renderer("pyrender", scene, CAMERA, platform=other)
        except RendererUnavailableError as error:
            assert "{platform}" in str(error) and other in str(error), error
        else:
            raise AssertionError("PyOpenGL cannot be loaded for two platforms")
        print("done")
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)],
        capture_output=True, text=True, timeout=120, check=False, cwd=Path(__file__).parents[1],
        env={k: v for k, v in os.environ.items() if k not in ("PYOPENGL_PLATFORM", "OPENMAP_GL")},
    )  # fmt: skip
    assert done.stdout.strip() == "done", done.stderr


FORK = """
    import os, signal
    import conftest
    from openmap_env.simulator import Simulator
    from openmap_scenes import PinholeCamera
    scene, camera = conftest.make_toy_scene(), PinholeCamera(32, 24, 20.0, 20.0, 15.5, 11.5)
    def look(name):
        simulator = Simulator(scene, camera, renderer=name)
        simulator.reset((-4.0, 0.0, 0.0), 0.0)
        assert simulator.observe().rgb.std() > 5.0
        return simulator
    before = look({name!r})
    child = os.fork()
    if not child:
        signal.alarm(30)
        before.step(2)
        for see in (before.observe, lambda: look({name!r})):
            try:
                see()
            except RuntimeError as error:
                print(error, flush=True)
        before.close()
        look("auto").close()
        print("closed", flush=True)
        os._exit(0)
    print(os.waitpid(child, 0)[1], flush=True)
    before.step(2)
    before.observe()
"""


@needs_osmesa
@pytest.mark.parametrize("name", ["opengl", "pyrender"])
def test_a_fork_of_a_process_that_has_drawn_says_so_instead_of_waiting_for_ever(name: str) -> None:
    def said(threads: str) -> list[str]:
        path = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
        code = textwrap.dedent(FORK.format(name=name))
        environment = {**os.environ, "PYTHONPATH": path, "LP_NUM_THREADS": threads}
        run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=90, env=environment)
        assert run.returncode == 0, run.stderr
        return run.stdout.splitlines()

    inherited, made, *rest = said("2")
    assert inherited == made
    assert "forked from one that had drawn already" in made
    assert "'spawn'" in made
    assert rest == ["closed", "0"]
    assert said("0") == ["closed", "0"], "without threads there is nothing to lose"
