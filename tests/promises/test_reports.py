from __future__ import annotations

import re
from dataclasses import replace
from html import unescape
from itertools import product
from xml.etree import ElementTree

from tests.promises.charts import COLORS, framed, timeline
from tests.promises.findings import Finding, count, how_often
from tests.promises.history import ALL, NO_TARGET, SENTINEL, Condition, History, InjectedFault
from tests.promises.html_report import html
from tests.promises.promises import CHECKERS, checked, overloads
from tests.promises.text_report import text

from .histories import END, change, faulty, good, killed, silent, succeeded, with_value


def faults_of(history: History) -> list[list[str]]:
    found = html("title", [], [], history).partition("<h2>Faults</h2>")[2].partition("</table>")[0]
    rows = found.split("<tr>")[2:]
    return [[unescape(cell) for cell in re.split(r"<td[^>]*>", row)[1:]] for row in rows]


def test_page_lists_every_fault_with_its_effect() -> None:
    history = killed(good(), "kinematics", 20.0, 0.6)
    pid = next(life.pid for life in history.lives if life.program == "velocity")
    history = faulty(
        history,
        InjectedFault("hang", "kinematics", 15.0, 30.0, 105),  # the kill at 20 s ends the process
        InjectedFault("stop", "velocity", 30.0, 33.5, pid),
        InjectedFault("raise", "config_l1", 40.0, 40.0),
        InjectedFault("flood", NO_TARGET, 41.0, 45.0),
        InjectedFault("kill_all", ALL, 50.0, 50.0),
    )
    alive = sum(life.ended is None for life in history.lives) - 1  # without supervisord
    assert faults_of(history) == [
        ["1", "15.0 s", "hang", "kinematics", "5.0 s", "process 105 survived"],
        ["2", "20.0 s", "kill", "kinematics", "–", KILLED],
        ["3", "30.0 s", "stop", "velocity", "3.5 s", f"process {pid} survived"],
        ["4", "40.0 s", "raise", "config_l1", "–", "no process: the program was restarting"],
        ["5", "41.0 s", "flood", "(no target)", "4.0 s", "–"],
        ["6", "50.0 s", "kill_all", "(whole arm)", "–", f"{alive} processes: 0 ended"],
    ]


KILLED = "process 105 ended after 0.00 s, the next one started 0.05 s later"


def test_numbers_and_nouns_agree() -> None:
    assert (count(1, "fault"), count(2, "fault"), count(0, "process")) == (
        "1 fault",
        "2 faults",
        "0 processes",
    )
    assert (how_often(1), how_often(2)) == ("once", "2 times")
    history = with_value(killed(good(), "engine_controller", 30.0, 0.6), "engines/state", "off", 30.5)
    assert CHECKERS["S2"](history).measured == "0 kills while on; turned off once for a permitted reason"
    assert CHECKERS["S3"](history).measured.startswith("turned on once, ")


def test_head_names_the_overloads_and_the_verdicts_that_they_weaken() -> None:
    history = silent(killed(good(), "kinematics", 20.0, 2.4), "engines/state", 40.0, 41.5)
    findings = [*checked(history)]
    assert overloads(history, findings) == "No overload of the machine or the observer"
    assert [each.promise for each in findings if each.evidence] == ["S3", "S6", "L1"]
    for faults, head in (
        ([(50.0, 50.5)], "1 overload of the machine or the observer, 0.5 s in all; weakened verdicts: none"),
        (
            [(21.0, 21.5), (21.25, 21.75), (40.25, 41.5)],
            "2 overloads of the machine or the observer, 2.0 s in all; weakened verdicts: S3, S6, L1",
        ),
    ):
        overloaded = faulty(history, *(Condition("overload", *each) for each in faults))
        findings = [*checked(overloaded)]
        assert overloads(overloaded, findings) == head


def test_overload_that_leaves_an_outcome_unknown_weakens_the_verdict() -> None:
    history = faulty(killed(good(), "velocity", 20.0, 1.5), Condition("overload", 20.75, 21.5))
    assert overloads(history, [*checked(history)]).endswith(" 0.8 s in all; weakened verdicts: L1")


def test_loss_is_no_overload() -> None:
    history = killed(good(), "kinematics", 20.0, 2.4)
    history = faulty(history, Condition("loss", 21.0, 21.5), Condition("overload", 50.0, 50.5))
    assert overloads(history, [*checked(history)]) == (
        "1 overload of the machine or the observer, 0.5 s in all; weakened verdicts: none"
    )


def test_durations_have_a_title_and_percentiles() -> None:
    back = killed(good(), "kinematics", 20.0, 0.6)
    hang = faulty(
        silent(good(), "effector/position", 20.0, 23.9), InjectedFault("stop", "kinematics", 20.0, 35.0)
    )
    report = text([CHECKERS["L1"](back), CHECKERS["L4"](hang)]).splitlines()
    for title, seconds in (("Silence after SIGKILL [s]", "0.60"), ("Silence after a hang [s]", "3.90")):
        row = report[report.index(title) + 2]
        assert row.split() == ["kinematics", "1", seconds, seconds]


def test_promise_without_cases_is_not_exercised() -> None:
    assert "not exercised" in text([CHECKERS["L1"](good())])
    assert Finding("L1", 0, "", unknown=1).summary == "outcome unknown"


def test_heading_states_the_verdict() -> None:
    headings = {
        "holds>All promises hold": [Finding("S1", 1, ""), Finding("L1", 2, "")],
        "unknown>No promise is violated, but S1, S6 not exercised": [
            Finding("S1", 0, ""),
            Finding("S6", 0, ""),
            Finding("L1", 2, ""),
        ],
        "unknown>No promise was exercised": [Finding("S1", 0, "")],
        "unknown>No promise is violated, but the outcome for L1 is unknown, and S2 not exercised": [
            Finding("S1", 1, ""),
            Finding("S2", 0, ""),
            Finding("L1", 0, "", unknown=2),
        ],
        "violated>L1 violated": [
            Finding("S1", 1, ""),
            CHECKERS["L1"](killed(good(), "kinematics", 20.0, 9.0)),
        ],
    }
    for heading, findings in headings.items():
        assert f"<h1 class={heading}</h1>" in html("title", [], findings, good())


def test_first_row_is_what_matters_most() -> None:
    findings = [*checked(killed(good(), "kinematics", 20.0, 9.0))]
    shown = re.findall(r"<td class='inline' data-title='name'>(\w\d)", html("title", [], findings, good()))
    assert shown == ["L1", "S1", "S6", "L4", "S2", "S3", "S4", "S5", "L2", "L3"]


def test_report_on_a_hang_names_who_did_not_act() -> None:
    pid = next(life.pid for life in good().lives if life.program == "config_l2")
    hung = faulty(silent(good(), "l2", 20.0, 30.0), InjectedFault("stop", "config_l2", 20.0, 40.0, pid))
    silenced = change(hung, "/diagnostics", lambda s: None if s.value[0] == SENTINEL and s.sent > 19.0 else s)
    hang = r"config_l2 hangs and is silent for \d+\.\d\d s"
    for history, words in (
        (hung, f"sentinel lived, but did not replace config_l2: {hang}"),
        (silenced, f"{hang}: sentinel was silent, too"),
        (
            succeeded(hung, "config_l2", 23.0),
            f"{hang}: it was killed after 3.00 s, but its successor was silent",
        ),
        (succeeded(hung, "config_l2", 26.0), "sentinel lived, but did not replace config_l2"),
    ):
        found = [CHECKERS["L4"](history)]
        for report in (text(found), html("title", [], found, history)):
            assert re.search(words, report)


def test_text_of_the_report_stands_out_from_what_is_behind_it() -> None:
    for scheme in re.findall(r":root \{([^}]*)\}", COLORS):
        colors = dict(re.findall(r"--(\w+): (#\w+);", scheme))
        for front, back in product(("text", "soft", "good", "bad", "open"), ("back", "card")):
            bright, dark = sorted((luminance(colors[front]), luminance(colors[back])), reverse=True)
            assert (bright + 0.05) / (dark + 0.05) >= 4.5, (front, back)


def luminance(color: str) -> float:
    """Return the relative luminance of a color such as ``#fff`` or ``#1d2327`` (WCAG 2.2)."""
    digits = color[1:] if len(color) == 7 else "".join(2 * digit for digit in color[1:])
    channels = [int(digits[at : at + 2], 16) / 255 for at in (0, 2, 4)]
    red, green, blue = (
        (each / 12.92 if each <= 0.04045 else ((each + 0.055) / 1.055) ** 2.4) for each in channels
    )
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def test_picture_is_well_formed_and_shows_every_fault() -> None:
    history = killed(good(), "kinematics", 20.0, 0.6)
    history = faulty(history, InjectedFault("stop", "velocity", 30.0, 33.5))
    svg = framed(*timeline(history, [CHECKERS["S1"](history)]), "a title with < and &")
    labels = [
        element.text for element in ElementTree.fromstring(svg).iter("{http://www.w3.org/2000/svg}text")
    ]
    assert {"a title with < and &", "1 kill", "2 stop", "kinematics", "(no target)"} <= set(labels)


def test_picture_of_a_long_history_is_drawn_at_a_smaller_scale() -> None:
    _, short, _ = timeline(replace(good(), end=END))
    _, long, _ = timeline(replace(good(), end=600.0))
    assert short < long < 10 * short
