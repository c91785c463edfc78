"""`make tables`: writes the tables of topics and parameters, and the graph of the nodes, into the READMEs."""

from __future__ import annotations

import re

from deploy.supervision.parameter_file import USE_SIM_TIME, declared
from deploy.supervision.processes import ROOT
from interfaces import topics

HEAD = (
    "| service | parameter | default | range | unit | settable | meaning |\n|---|---|---|---|---|---|---|\n"
)


def main() -> None:
    for page in PAGES:
        path = ROOT / page
        path.write_text(updated(page, path.read_text(encoding="utf-8")), encoding="utf-8")


def updated(page: str, text: str) -> str:
    """Return the text of a page with what the code states."""
    for part in PAGES[page]:
        stated = part()
        head, _, _ = stated.partition("\n")
        text, count = re.subn(rf"{re.escape(head)}\n([| ].*\n)+", lambda _, new=stated: new, text)  # type: ignore[misc]
        assert count == 1, f"{page} needs one part that begins with {head}"
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


PAGES = {"interfaces/README.md": (topics.markdown, parameters), "services/README.md": (topics.mermaid,)}
"""The generated parts of each page."""


def _shown(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _range(within: tuple[object, object] | None) -> str:
    return f"{_shown(within[0])} to {_shown(within[1])}" if within else ""


if __name__ == "__main__":
    main()
