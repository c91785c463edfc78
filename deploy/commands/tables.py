"""`make tables`: writes the tables of topics and parameters into interfaces/README.md."""

from __future__ import annotations

import re
from pathlib import Path

from deploy.running.parameter_file import USE_SIM_TIME, declared
from interfaces import topics

README = Path(__file__).resolve().parents[2] / "interfaces" / "README.md"
HEAD = (
    "| service | parameter | default | range | unit | settable | meaning |\n|---|---|---|---|---|---|---|\n"
)


def main() -> None:
    """Bring the tables up to date."""
    README.write_text(updated(README.read_text(encoding="utf-8")), encoding="utf-8")


def updated(text: str) -> str:
    """Return the text with the tables that the code states."""
    for table in (topics.markdown(), parameters()):
        head = re.escape(table[: table.index("\n") + 1])
        text, count = re.subn(rf"{head}(\|.*\n)+", lambda _, table=table: table, text)  # type: ignore[misc]
        assert count == 1, f"{README} has no table that begins with {table.splitlines()[0]}"
    return text


def parameters() -> str:
    """Return the parameters of all programs as a table."""
    rows = [
        f"| {program} | `{each.name}` | {_shown(each.default)} | {_range(each.within)} | {each.unit} "
        f"| {'yes' if each.settable else ''} | {each.meaning} |\n"
        for program, found in declared().items()
        for each in found.values()
        if each != USE_SIM_TIME
    ]
    return HEAD + "".join(rows)


def _shown(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _range(within: tuple[object, object] | None) -> str:
    return f"{_shown(within[0])} to {_shown(within[1])}" if within else ""


if __name__ == "__main__":
    main()
