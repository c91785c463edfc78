"""`make new-service NAME=torque_guard`: writes a guard that is ready to be edited, with all that names it.

The template is the example of the README, services/examples/speed_guard.py, with its test. The new service
gets a topic of its own. Nobody publishes it yet, so the service does nothing until it is edited.
"""

from __future__ import annotations

import keyword
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from deploy.operator.output import use_plain_output
from deploy.supervision.processes import ROOT

TOPICS, MANIFEST = Path("interfaces/topics.py"), Path("deploy/supervisord.conf")
PAGES = (Path("interfaces/README.md"), Path("services/README.md"))
EXAMPLE, ITS_TEST = Path("services/examples/speed_guard.py"), Path("tests/component/test_speed_guard.py")
NAME = r"(?!.{31})[a-z][a-z0-9]*(_[a-z0-9]+)*"  # of a module, of a node and of a part of a topic
LAST_TOPIC = "DIAGNOSTICS = Topic("
LAST_PROGRAMS = "operator_page, sentinel\n"
LAST_SECTIONS = "[program:operator_page]\n"
ENGINES = {"ENGINES": 4, "ENGINES_STATE": 5}
"""The topics of a guard besides its own, each with the lines of its row before the nodes that it joins."""


class Refused(Exception):
    """Why there is no new service; a line for the user."""


def main() -> None:
    use_plain_output()
    name = sys.argv[1]
    try:
        check(name)
        with _all_or_nothing(texts(name)) as paths:
            _run("ruff", "format", "--quiet", *paths)
            _run("deploy.commands.tables")
    except Refused as error:
        sys.exit(f"make new-service: {error}")
    except OSError as error:
        sys.exit(f"make new-service: {error.filename}: {error.strerror}; nothing is written")
    print(f"Wrote services/{name}.py, its test, its topic and its section of the manifest. Now edit")
    print(f"  services/{name}.py: what it guards        {TOPICS}: its topic, or one that exists")
    print("Then: make tables, make check, make test TESTS=tests/component")


def check(name: str) -> None:
    """Raise Refused for a name that a service cannot have."""
    if not re.fullmatch(NAME, name) or keyword.iskeyword(name):
        raise Refused(f"NAME={name}: must be a name of up to 30 small letters, such as torque_guard")
    for path in (Path("services", name), *_own_files(name)):
        if os.path.lexists(ROOT / path):
            raise Refused(f"NAME={name}: is taken by {path}")
    for path, use in ((MANIFEST, rf":{name}\]"), (TOPICS, rf'"{name}"')):
        for number, line in enumerate(_read(path).splitlines(), 1):
            if re.search(use, line):
                raise Refused(f"NAME={name}: is taken by {path}, line {number}: {line.strip()}")


def texts(name: str) -> dict[Path, str]:
    """Return the files of a new service, and those that name it, with their new texts."""
    service, test = _own_files(name)
    return {
        service: _guard(_read(EXAMPLE), name),
        test: _guard(_read(ITS_TEST), name),
        TOPICS: _with_topic(_read(TOPICS), name),
        MANIFEST: _with_program(_read(MANIFEST), name),
    }


def _own_files(name: str) -> tuple[Path, Path]:
    return Path("services", f"{name}.py"), Path("tests", "component", f"test_{name}.py")


def _guard(example: str, name: str) -> str:
    title = name.replace("_", " ")
    story = f"""The {title}: turns the engines off when a value is too great.

User story (ours): as a robot operator, I find the engines off after a value of
`{name}/input` was too great.
"""
    guard, rest = _filled(
        example,
        {
            "Turns the engines off when the effector is too fast.": story,
            " when a speed is above the limit [m/s]": " when a value is above the limit",
            "lambda speed: speed > limit": "lambda value: value > limit",
            "when_a_speed_is": "when_a_value_is",
            '"m/s", "greatest speed allowed"': '"", "greatest value allowed"',
            "(topics.EFFECTOR_TWIST).map(lambda twist: twist.speed)": f"(topics.{_constant(name)})",
            "services.examples.": "services.",
            "speed_guard": name,
            "too_fast": "too_great",
            "speeds": "values",
        },
    )
    if "speed" in rest:
        raise Refused(
            f"{EXAMPLE} or {ITS_TEST}: is no template of a guard any more; adapt {Path(__file__).name}"
        )
    return guard


def _filled(template: str, words: Mapping[str, str]) -> tuple[str, str]:
    """Return a template with other words, and what they leave of it. A new word may contain an old one."""
    places = re.compile("|".join(map(re.escape, words)))
    return places.sub(lambda found: words[found[0]], template), places.sub("", template)


def _with_topic(contract: str, name: str) -> str:
    row = f"""{_constant(name)} = Topic(
    "{name}/input",
    Float64,
    _EVENTS,
    "",
    ("sensor",),
    ("{name}",),
    "what `{name}` limits",
    _not_usable,
    longest_gap=math.inf,
)
"""
    contract = _once(TOPICS, contract, LAST_TOPIC, row + LAST_TOPIC)
    for topic, lines in ENGINES.items():
        nodes = rf"\n{topic} = Topic\((?:\n    .*){{{lines}}}\n    \("
        contract, count = re.subn(nodes, rf'\g<0>"{name}", ', contract)
        if count != 1:
            raise Refused(f"{TOPICS}: has no `{topic} = Topic(` with nodes in line {lines + 2}")
    return contract


def _with_program(manifest: str, name: str) -> str:
    manifest = _once(MANIFEST, manifest, LAST_PROGRAMS, f"{name}, {LAST_PROGRAMS}")
    _, found, last = manifest.rpartition("[program:sentinel]")
    words = {"deploy.supervision.sentinel": f"services.{name}", "sentinel": name}
    section, _ = _filled(f"{found}{last.rstrip()}\n\n", words)
    return _once(MANIFEST, manifest, LAST_SECTIONS, section + LAST_SECTIONS)


def _constant(name: str) -> str:
    return f"{name.upper()}_INPUT"


def _once(path: Path, text: str, old: str, new: str) -> str:
    if text.count(old) != 1:
        raise Refused(f"{path}: needs one `{old.strip()}`, where a service is added")
    return text.replace(old, new)


def _read(path: Path) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


def _run(*words: str) -> None:
    done = subprocess.run([sys.executable, "-m", *words], cwd=ROOT, capture_output=True, text=True)
    if done.returncode:
        where = re.findall(rf'File "{re.escape(str(ROOT))}/(.*)", (line \d+)', done.stderr)
        cause = (done.stderr.strip() or f"exit code {done.returncode}").splitlines()[-1]
        raise Refused(": ".join([words[0], *map(", ".join, where[-1:]), cause]))


@contextmanager
def _all_or_nothing(changes: Mapping[Path, str]) -> Iterator[list[str]]:
    """Write files; take all changes back, those of the block included, if anything fails."""
    before = {path: _read(path) for path in (TOPICS, MANIFEST, *PAGES)}
    written = []
    try:
        for path, text in changes.items():
            written.append(path)
            (ROOT / path).write_text(text, encoding="utf-8")
        yield [str(path) for path in changes if path.suffix == ".py"]
    except BaseException:
        for path in before:
            if _read(path) != before[path]:
                (ROOT / path).write_text(before[path], encoding="utf-8")
        for path in {*written} - {*before}:
            (ROOT / path).unlink(missing_ok=True)
        raise


if __name__ == "__main__":
    main()
