from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from deploy.supervision.processes import ROOT
from tests.mutants import __main__ as command
from tests.mutants import checkout as module
from tests.mutants.checkout import CheckoutCopy
from tests.mutants.guards import GUARDS
from tests.mutants.mutations import Mutant, mutants

CLAMP = '''
def clamp(value, limit=9):
    """Return the lesser one."""
    if value > limit:
        log(value)
        value = limit
    return value


def log(value):
    print("too much", value, flush=True)
'''
CHANGES = {
    "clamp: def clamp(value, limit=9): → def clamp(value, limit=10):",
    "clamp: if value > limit: → if value >= limit:",
    "clamp: if value > limit: → if not (value > limit):",
    "clamp: log(value) → pass",
    "clamp: log(value) → log(None)",
    "clamp: value = limit → value = None",
    'log: print("too much", value, flush=True) → pass',
    'log: print("too much", value, flush=True) → print(None, value, flush=True)',
    'log: print("too much", value, flush=True) → print("too much", None, flush=True)',
    'log: print("too much", value, flush=True) → print("too much", value, )',
    'log: print("too much", value, flush=True) → print("XXtoo muchXX", value, flush=True)',
    'log: print("too much", value, flush=True) → print("too much", value, flush=False)',
}


def made(tmp_path: Path, source: str) -> list[Mutant]:
    (tmp_path / "clamp.py").write_text(source)
    return list(mutants(tmp_path, "clamp.py"))


def test_mutants_change_one_thing_each(tmp_path: Path) -> None:
    assert {mutant.change for mutant in made(tmp_path, CLAMP)} == CHANGES


def test_change_is_the_same_where_the_function_moves(tmp_path: Path) -> None:
    before = made(tmp_path, CLAMP)
    after = made(tmp_path, "import os\n\n" + CLAMP)

    assert [mutant.change for mutant in after] == [mutant.change for mutant in before]
    assert [mutant.line for mutant in after] == [mutant.line + 2 for mutant in before]


def test_types_and_start_of_a_program_are_not_mutated(tmp_path: Path) -> None:
    source = 'T = TypeVar("T")\n__all__ = ["T"]\nif __name__ == "__main__":\n    run("x")\n'
    assert made(tmp_path, source) == []


def test_modules_and_their_tests_exist() -> None:
    named = [path for module, tests in GUARDS.items() for path in (module, *tests)]
    assert [path for path in named if not (ROOT / path).is_file()] == []


@pytest.fixture
def copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[CheckoutCopy]:
    monkeypatch.setattr(module, "_ALLOWANCE", 1.0)
    checkout = tmp_path / "checkout"
    (checkout / "tests" / "mutants").mkdir(parents=True)
    for name in ("pyproject.toml", "tests/mutants/runner.py"):
        shutil.copy(ROOT / name, checkout / name)
    (checkout / "conftest.py").write_text(
        'from hypothesis import settings\n\nsettings.register_profile("mutants")\n'
    )
    (checkout / "clamp.py").write_text(CLAMP)
    (checkout / "test_clamp.py").write_text(
        "from clamp import clamp\n\ndef test_clamp():\n    assert (clamp(8), clamp(10)) == (8, 9)\n"
    )
    subprocess.run(["git", "init", "-q", str(checkout)], check=True)
    made = CheckoutCopy(checkout, tmp_path / "copy")
    yield made
    made.close()
    assert (checkout / "clamp.py").read_text() == CLAMP


def changed(before: str, after: str) -> Mutant:
    return Mutant("clamp.py", 1, "", CLAMP.replace(before, after))


def test_mutant_dies_where_a_test_fails_or_hangs(copy: CheckoutCopy) -> None:
    tests = ("test_clamp.py",)

    assert copy.kills(changed("value = limit", "value = None"), tests)
    assert not copy.kills(changed("too much", "too many"), tests)
    assert copy.kills(changed("value = limit", "while True: pass"), tests)
    assert not copy.kills(changed("value > limit", "value >= limit"), tests)


def test_tests_that_fail_without_a_mutant_are_an_error(copy: CheckoutCopy) -> None:
    with pytest.raises(RuntimeError, match=r"fail without a mutant: missing\.py"):
        copy.kills(changed("9", "10"), ("missing.py",))


def score(*survivors: str) -> command.Score:
    return command.Score(3, 3 - len(survivors), 0, [Mutant("clamp.py", 7, each, "") for each in survivors])


@pytest.mark.parametrize(
    ("survivors", "listed", "code"),
    [((), (), 0), (("a",), ("a",), 0), (("a", "b"), ("a",), 1), ((), ("a",), 1)],
)
def test_command_fails_unless_the_survivors_are_the_listed_ones(
    survivors: tuple[str, ...], listed: tuple[str, ...], code: int, capsys: pytest.CaptureFixture[str]
) -> None:
    equivalent = {"clamp.py": dict.fromkeys(listed, "it changes nothing")}

    assert command.report({"clamp.py": score(*survivors)}, equivalent) == code

    gone = 'clamp.py: listed as equivalent, but killed or gone: "a"'
    assert (gone in capsys.readouterr().out) == (bool(listed) and not survivors)


def test_unknown_module_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert command.main(["services/nothing.py"]) == 2
    assert capsys.readouterr().err.startswith("No tests guard services/nothing.py.")


INTERRUPTED = """
import os, signal, sys
import libcst
from tests.mutants import __main__ as command

write = libcst.Name._codegen_impl

def interrupted(name, *arguments, **options):
    os.kill(os.getpid(), signal.SIGINT)
    write(name, *arguments, **options)

libcst.Name._codegen_impl = interrupted
sys.exit(command.main(["interfaces/reactive_node/src/reactive_node/stamps.py"]))
"""


def test_ctrl_c_while_a_mutant_is_written_shows_no_traceback() -> None:
    done = subprocess.run([sys.executable, "-c", INTERRUPTED], cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (130, "")
    assert done.stdout.startswith("Interrupted. Nothing in this checkout has changed. So far:\n")
