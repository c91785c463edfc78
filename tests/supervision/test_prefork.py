"""Programs that a warm supervisord runs in its fork, as a new interpreter would run them."""

from __future__ import annotations

import importlib
import os
import pkgutil
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.supervision import manifest, prefork
from deploy.supervision.processes import ROOT
from reactive_node.domains import reserved_domain

PYTHON = str(Path(sys.executable).with_name("python3"))
WARM = """
import os, signal, sys
from deploy.supervision import prefork
sys.is_supervisord = True
signal.signal(signal.SIGTERM, lambda number, frame: print("supervisord's handler"))
{more}
prefork.executor(os.execve)(sys.argv[1], sys.argv[1:], {{**os.environ, "SUPERVISOR_PROCESS_NAME": "probe"}})
"""
WORDS = ("Zürich", "", "--ros-args")


def run(
    folder: Path, program: str, *, more: str = "", python: str = PYTHON
) -> subprocess.CompletedProcess[str]:
    path = [os.environ["PYTHONPATH"]] if "PYTHONPATH" in os.environ else []  # where ROS 2 has its packages
    (folder / "probe.py").write_text("import atexit, os, signal, sys, threading\n" + program)
    return subprocess.run(
        [sys.executable, "-c", WARM.format(more=more), python, "-m", "probe", *WORDS],
        cwd=folder,  # comes first in the path
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), *path])},
        capture_output=True,
        text=True,
        timeout=150.0,
    )


POOL = "from concurrent.futures import ThreadPoolExecutor\nsys.pool = ThreadPoolExecutor(1)\n"
FORKED = "print(hasattr(sys, 'is_supervisord'), flush=True)"


def test_program_sees_its_own_command_line_and_environment(tmp_path: Path) -> None:
    done = run(
        tmp_path,
        "assert __name__ == '__main__'\n"
        "read = lambda name: open(f'/proc/self/{name}', 'rb').read().decode().split(chr(0))\n"
        "assert read('cmdline')[1:] == ['-m', 'probe', *sys.argv[1:], ''], read('cmdline')\n"
        "assert sorted(read('environ')[:-1]) == sorted(f'{k}={v}' for k, v in os.environ.items())\n"
        f"print(os.environ['SUPERVISOR_PROCESS_NAME'], sys.argv[1:]); {FORKED}",
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, f"probe {list(WORDS)}\nTrue\n", "")


@pytest.mark.parametrize(
    ("end", "code", "printed"),
    [
        ("", 0, ""),
        ("sys.exit()", 0, ""),
        ("sys.exit(3)", 3, ""),
        ("sys.exit('what, where')", 1, "what, where\n"),
        ("os.kill(os.getpid(), signal.SIGTERM)", -signal.SIGTERM, ""),
        ("os._exit(4)", 4, ""),
    ],
)
def test_program_ends_with_its_exit_code(tmp_path: Path, end: str, code: int, printed: str) -> None:
    done = run(tmp_path, f"{FORKED}\n{end}")
    assert (done.returncode, done.stdout, done.stderr) == (code, "True\n", printed)


def test_error_of_a_program_is_a_traceback(tmp_path: Path) -> None:
    done = run(tmp_path, "raise ValueError('what')")
    assert done.returncode == 1
    assert done.stderr.startswith("Traceback")
    assert done.stderr.endswith("ValueError: what\n")


def test_threads_and_exit_handlers_end_before_the_program(tmp_path: Path) -> None:
    done = run(
        tmp_path,
        "atexit.register(print, 'exit handler')\n"
        "threading.Timer(0.2, print, ['thread']).start()\n"
        "threading.Thread(target=signal.pause, daemon=True).start()",
    )
    assert (done.returncode, done.stdout) == (0, "thread\nexit handler\n")


@pytest.mark.parametrize(("end", "code"), [("", 0), ("raise ValueError('a bug')", 1), ("sys.exit(3)", 3)])
def test_idle_threads_of_a_pool_keep_no_program_alive(tmp_path: Path, end: str, code: int) -> None:
    work = "sys.pool.submit(print, 'work').result()\natexit.register(print, 'exit')\n"
    done = run(tmp_path, POOL + work + end)
    assert (done.returncode, done.stdout) == (code, "work\nexit\n")


def test_work_of_a_pool_is_done_before_the_program_ends(tmp_path: Path) -> None:
    work = "lambda: (threading.Event().wait(0.2), print('late work'))"
    done = run(tmp_path, f"{POOL}atexit.register(print, 'exit handler')\nsys.pool.submit({work})")
    assert (done.returncode, done.stdout) == (0, "late work\nexit handler\n")


def test_customization_of_the_site_runs_for_each_program(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text("import os; name = os.environ.get('SUPERVISOR_PROCESS_NAME')")
    done = run(tmp_path, "import sitecustomize; print(sitecustomize.name)")
    assert done.stdout == "probe\n"


@pytest.mark.parametrize(
    ("more", "python"),
    [
        ("prefork.set_command_line = lambda *_: os.stat('/no/such/kernel')", PYTHON),
        ("", os.path.realpath(PYTHON)),
    ],
    ids=["a kernel that cannot rename", "a Python elsewhere"],
)
def test_new_interpreter_runs_where_a_fork_cannot(tmp_path: Path, more: str, python: str) -> None:
    done = run(tmp_path, FORKED, more=more, python=python)
    assert (done.returncode, done.stdout, done.stderr) == (0, "False\n", "")


def test_library_that_fails_does_not_end_supervisord(tmp_path: Path) -> None:
    (tmp_path / "yaml.py").write_text("raise RuntimeError('broken')")
    done = run(tmp_path, FORKED, more="prefork.import_libraries()")
    assert (done.returncode, done.stdout) == (0, "True\n")


def test_signals_of_a_program_do_not_wake_supervisord(tmp_path: Path) -> None:
    more = "pipe = os.pipe(); os.set_blocking(pipe[1], False); signal.set_wakeup_fd(pipe[1])"
    done = run(tmp_path, f"print(signal.set_wakeup_fd(-1)); {FORKED}", more=more)
    assert (done.stdout, done.stderr) == ("-1\nTrue\n", "")


@pytest.mark.parametrize("name", ["deploy.supervision.rpc", "interfaces.plain_text"])
def test_edited_module_of_the_checkout_counts_at_the_next_start(tmp_path: Path, name: str) -> None:
    for package in ("deploy", "interfaces"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=lambda *_: ["reactive_node"])
    file = f"{name.replace('.', '/')}.py"
    edit = f"import {name}; open({file!r}, 'a').write('EDITED = True')"
    done = run(tmp_path, f"import {name}; print({name}.EDITED); {FORKED}", more=edit)
    assert (done.stdout, done.stderr) == ("True\nTrue\n", "")


def test_numpy_is_imported_at_its_first_use(tmp_path: Path) -> None:
    program = (
        "counts = [sum(name.startswith('numpy') for name in sys.modules)]\n"
        "import numpy as np, numpy.linalg; from numpy import zeros\n"
        "assert np.__version__ and np.dtype('f8') == zeros(3).dtype and numpy.linalg.norm(zeros(3)) == 0.0\n"
        f"print(counts); {FORKED}"
    )
    done = run(tmp_path, program, more="prefork.import_libraries()")
    assert (done.stdout, done.stderr) == ("[1]\nTrue\n", "")


def test_log_message_looks_only_at_new_modules(tmp_path: Path) -> None:
    """rclpy names the caller of each log message, and so asks ``inspect`` for the files of all modules."""
    count = "import inspect, reactivex; print(reactivex.__file__ in inspect.modulesbyfile)"
    done = run(tmp_path, f"{count}; {FORKED}", more="prefork.import_libraries()")
    assert done.stdout == "True\nTrue\n"


@pytest.mark.parametrize("name", prefork.libraries())
def test_prepared_library_exists(name: str) -> None:
    importlib.import_module(name)


@pytest.mark.parametrize("name", prefork.types())
def test_prepared_type_exists(name: str) -> None:
    assert isinstance(pkgutil.resolve_name(name), type)


NEW = "[name for name in sys.modules if name not in before and name.partition('.')[0] not in OURS]"
OURS = ("deploy", "interfaces", "services", "probe")
"""Packages of the checkout: a service reads them at each start."""


def test_programs_of_the_manifest_import_no_library_again(tmp_path: Path) -> None:
    modules = {program.module for program in manifest.programs()}
    use = f"OURS = {OURS}\nbefore = set(sys.modules)\nimport {', '.join(modules)}\nprint({NEW})\n"
    done = run(tmp_path, f"{use}{FORKED}", more="import supervisor.supervisord; prefork.import_libraries()")
    assert (done.stdout, done.stderr) == ("[]\nTrue\n", "")


def test_supervisord_has_no_dds_and_no_thread_but_those_of_tracing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """ROS 2's rclpy loads LTTng, whose two threads wait for a session and hold no lock."""
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")  # as supervisord has it
    count = (
        "from pathlib import Path\n"
        "threads = len(os.listdir('/proc/self/task'))\n"
        "expected = 3 if 'liblttng-ust' in Path('/proc/self/maps').read_text() else 1\n"
        "links = [os.readlink(f'/proc/self/fd/{number}') for number in range(3, 100)\n"
        "    if os.path.exists(f'/proc/self/fd/{number}')]\n"
        "print(threads - expected, [link for link in links if 'socket' in link])\n"
    )
    done = run(tmp_path, f"{count}{FORKED}", more="prefork.import_libraries()")
    assert (done.stdout, done.stderr) == ("0 []\nTrue\n", "")


def test_service_prepares_no_type_and_no_pattern_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A type loads a library on its first use; Python compiles a pattern once."""
    use = (
        "import builtins, json, re\n"
        f"OURS = {OURS}\n"
        "before = set(sys.modules)\n"
        "import rclpy\n"
        "from interfaces.service import ServiceNode\n"
        "from rclpy.logging import get_logger\n"
        "prepared = []\n"
        "def recording(function):\n"
        "    def record(what, *options, **others):\n"
        "        prepared.append(str(what)[:99])\n"
        "        return function(what, *options, **others)\n"
        "    return record\n"
        "get_logger('probe').info('the format of the log is that of the environment')\n"
        "builtins.compile, json.dumps = recording(compile), recording(json.dumps)\n"
        "re._compiler.compile = recording(re._compiler.compile)\n"
        "rclpy.init()\n"
        "node = ServiceNode('probe')\n"
        "node.declare_parameter('period', 1.0)\n"
        "node.health.report()\n"
        f"print(prepared, {NEW})\n"
        "node.destroy_node()\n"
        "rclpy.shutdown()\n"
    )
    with reserved_domain() as domain_id:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain_id))
        done = run(tmp_path, f"{use}{FORKED}", more="prefork.import_libraries()")
    assert done.stdout == "[] []\nTrue\n"


CHANGING = """
executor = prefork.executor
def changing(execve):
    execute = executor(execve)
    def changed(filename, argv, environment):
        {change}
        execute(filename, argv, environment)
    return changed
prefork.executor = changing
"""


@pytest.mark.parametrize(
    ("change", "forked"),
    [
        ("environment['MINE'] = 'yes'", True),
        ("environment['PYTHONPATH'] += ':/elsewhere'", False),
        ("environment['LD_LIBRARY_PATH'] = '/elsewhere:' + environment.get('LD_LIBRARY_PATH', '')", False),
        ("os.chdir('elsewhere')", False),
    ],
)
def test_program_with_another_path_or_directory_has_its_own_interpreter(
    tmp_path: Path, change: str, forked: bool
) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "probe.py").write_text(f"import sys; {FORKED}")
    done = run(tmp_path, FORKED, more=CHANGING.format(change=change))
    assert (done.stdout, done.stderr) == (f"{forked}\n", "")
