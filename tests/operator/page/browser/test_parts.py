"""Parts of the page in a browser, driven by states that the tests choose."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest

from deploy.operator.page.site import STATIC
from tests.operator.page.clients import Arm

pytestmark = pytest.mark.timed

RECOVERIES = """
async () => {
    const { Processes } = await import("/static/processes.js");
    const table = new Processes(() => true);
    const welcome = () => ({ programs: ["velocity"], local: true });
    const row = () => document.querySelector("tr[data-process=velocity]");
    const health = () => row().querySelector("[data-column=health]").textContent;
    const show = (welcome, time, state, pid) => {
        const ok = state === "RUNNING";
        const told = { host: "", restarts: 0, since_output: 0, health: "good" };
        table.render({ processes: [{ ...told, name: "velocity", state, pid, ok }], welcome, time }, true);
        return row().dataset.back ? health() : "";
    };
    const first = welcome(), second = welcome();
    return [
        show(first, 100, "UNKNOWN", 0),
        show(first, 101, "RUNNING", 7), // since long ago: nobody saw it
        show(first, 102, "STARTING", 8),
        show(first, 103, "RUNNING", 8),
        show(first, 200, "RUNNING", 9), // between two states
        show(second, 300, "UNKNOWN", 0), // a new connection
        show(second, 301, "RUNNING", 10),
    ];
}
"""

HOSTS = """
async () => {
    const { Processes } = await import("/static/processes.js");
    const table = new Processes(() => true);
    const process = { name: "velocity", state: "RUNNING", pid: 7, restarts: 0, ok: true, since_output: 0 };
    return ["", "robot1", "robot1, robot2", ""].map((host) => {
        table.render({ processes: [{ ...process, host }], time: 0 }, true);
        return document.querySelector("tr[data-process=velocity] th").innerText.trim();
    });
}
"""

OVERLAPS = """
async () => {
    const { labelPlaces } = await import("/static/arm.js");
    const label = document.querySelector("#arm .angle-label");
    label.textContent = "θ₁ 0180.0°";
    label.parentNode.setAttribute("visibility", "visible");
    const { width, height } = label.getBBox();
    const found = [];
    for (let one = -180; one <= 180; one += 5) {
        for (let two = -180; two <= 180; two += 5) {
            for (const link of [0, 30, 54, 108]) {
                const angle = one * Math.PI / 180;
                const elbow = [link * Math.cos(angle), -link * Math.sin(angle)];
                const [a, b] = labelPlaces(angle, two * Math.PI / 180, elbow);
                const overlap = Math.abs(a[0] - b[0]) < width && Math.abs(a[1] - b[1]) < height;
                if (overlap) found.push([one, two, link]);
            }
        }
    }
    return [width, found];
}
"""

ARCS = """
async () => {
    const { Arm } = await import("/static/arm.js");
    const arm = new Arm();
    const trace = { from: () => 0, length: 0 };
    const shown = (theta1, theta2) => {
        arm.render({ arm: { l1: 1, l2: 1, theta1, theta2 }, position: null, trace, time: 0, speed: 0 });
        return [...document.querySelectorAll("#arm > :last-child .angle-label")].map((it) => it.textContent);
    };
    return [shown(0.5, 0), shown(0, -0.5), shown(2 * Math.PI, 0.5)];
}
"""

SPEEDS = """
async () => {
    const { usualSpeed } = await import("/static/speed_plot.js");
    const minute = (...speeds) => Float64Array.from({ length: 1800 }, (_, n) => speeds[n % speeds.length]);
    const spiked = minute(1, 2, 3);
    spiked.fill(70, 0, 90); // a twentieth of the time
    const seldom = minute(0);
    seldom.fill(2, 0, 60);
    return [minute(0), minute(1, 2, 3), spiked, seldom].map(usualSpeed);
}
"""

HISTORY = """
async () => {
    const { Model } = await import("/static/model.js");
    const operator = { seen: true, age: null, activity: "alive", strikes_left: 2 };
    const hold = { held: true, by: "other_page" };
    const past = { switch: hold, operator, engines: { state: "on" } };
    const welcome = { strikes: 3, history: [[10, past], [20, null], [25, past]] };
    const now = { time: 30, switch: hold, operator, engines: { state: "off", why: "", refused: null } };
    const model = new Model();
    const shown = () => [model.hands, model.strikes, model.engineStates].map((it) => it.items);
    model.begin(welcome);
    model.update(now);
    const opened = JSON.stringify(shown());
    model.begin(welcome);
    return [JSON.parse(opened), JSON.stringify(shown()) === opened];
}
"""

EVENTS = """
async () => {
    const { Lines } = await import("/static/lines.js");
    const buttons = document.getElementById("line-kinds");
    buttons.replaceWith(buttons.cloneNode(true)); // which the page's own list does not hear
    const lines = new Lines();
    const positions = Array.from({ length: 500 }, () => ({ time: 0, kind: "position", text: "here" }));
    const list = document.getElementById("lines");
    const shown = () => [...list.children].filter((it) => it.checkVisibility()).map((it) => it.textContent);
    lines.add([{ time: 1, kind: "state", text: "off" }, { time: 2, kind: "process", text: "died" }]);
    lines.add(positions);
    const first = shown();
    const press = (group) => document.querySelector(`[data-shows=${group}]`).click();
    press("engines");
    const second = shown();
    press("steady");
    return [first, second, shown().length];
}
"""

STRIKES = """
async () => {
    const { Operator } = await import("/static/operator.js");
    const operator = new Operator();
    const welcome = { strikes: 3, silence: 3, presence_timeout: 10 };
    return [3, 1, 0].map((left) => {
        operator.render({ operator: { seen: true, age: 0, activity: "alive", strikes_left: left }, welcome });
        return ["strikes-text", "mini-strikes"].map((id) => document.getElementById(id).textContent);
    });
}
"""

ALERTS = """
async () => {
    const { Operator } = await import("/static/operator.js");
    const operator = new Operator();
    const alert = document.getElementById("alert");
    return [null, false, true, false].map((seen) => {
        alert.replaceChildren();
        operator.render({ operator: { seen, age: 0, activity: null, strikes_left: null } });
        return alert.textContent;
    });
}
"""

SIGNS = """
async (script) => {
    const { RELEASED, step } = await import("/static/hold.js");
    let state = RELEASED;
    const seen = [];
    let now = 0;
    const feed = (event) => { state = step(state, { at: now, ...event }).state; };
    for (; now <= 12000; now += 50) {
        feed({ type: "update", nonce: "n" });
        for (const [at, event] of script) if (at === now) feed(event);
        const before = state.held;
        feed({ type: "tick", wall: now });
        if (state.held !== before) seen.push([now, state.why]);
    }
    return [seen, state.held];
}
"""


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    with closing(Arm(STATIC)) as arm, closing(browser.new_context()) as context:
        page = context.new_page()
        page.goto(f"http://{arm.host}/")
        page.wait_for_selector("html[data-connection=closed]")
        yield page


def test_only_recoveries_that_the_page_has_seen_are_told(page: Any) -> None:
    assert page.evaluate(RECOVERIES) == ["", "", "", *2 * ["is back"], "", ""]


def test_host_stands_with_the_name_of_a_process(page: Any) -> None:
    name = "velocity"
    hosts = ["robot1", "robot1, robot2"]
    assert page.evaluate(HOSTS) == [name, *(f"{name}\n{host}" for host in hosts), name]


def test_labels_of_the_angles_never_overlap(page: Any) -> None:
    width, overlaps = page.evaluate(OVERLAPS)
    assert width > 20
    assert overlaps == []


def test_angle_without_an_arc_has_no_label(page: Any) -> None:
    assert page.evaluate(ARCS) == [["θ₁ 28.6°", ""], ["", "θ₂ \N{MINUS SIGN}28.6°"], ["", "θ₂ 28.6°"]]


def test_spikes_do_not_spoil_the_scale_of_the_speed(page: Any) -> None:
    assert page.evaluate(SPEEDS) == [0, 3, 3, 2]


def test_new_page_shows_the_last_minute_of_the_server(page: Any) -> None:
    hands = [[10, "other_page"], [20, None], [25, "other_page"]]
    strikes = [[10, 1], [20, None], [25, 1]]
    engines = [[10, "on"], [20, None], [25, "on"], [30, "off"]]
    assert page.evaluate(HISTORY) == [[hands, strikes, engines], True]


def test_positions_are_hidden_until_they_are_wanted_and_push_out_nothing(page: Any) -> None:
    assert page.evaluate(EVENTS) == [["[2] died", "[1] off"], ["[2] died"], 201]


def test_strikes_are_told_as_strikes_that_are_left(page: Any) -> None:
    assert page.evaluate(STRIKES) == [
        ["3 of 3 strikes left", "3 strikes left"],
        ["1 of 3 strikes left", "1 strike left"],
        ["0 of 3 strikes left", "0 strikes left"],
    ]


def test_first_state_of_the_operator_is_no_alarm(page: Any) -> None:
    assert page.evaluate(ALERTS) == ["", "", "", "Operator not seen."]


DOWN = {"type": "down", "hand": "key", "lasts": 3000, "lack": "no sign"}
SIGN = {"type": "sign", "hand": "key", "lasts": 500, "lack": "no sign"}
NO_SIGN = "Released: no sign"


@pytest.mark.parametrize(
    ("script", "expected"),
    [
        ([(100, {"type": "down", "hand": "mouse"})], [[], True]),
        ([(100, DOWN)], [[[3150, NO_SIGN]], False]),
        ([(100, DOWN), (700, SIGN)], [[[1250, NO_SIGN]], False]),
        ([(100, DOWN), *((at, SIGN) for at in range(700, 12000, 500))], [[], True]),
        ([(100, DOWN), (700, SIGN), (750, SIGN | {"lasts": 9000})], [[[9800, NO_SIGN]], False]),
        ([(100, DOWN), (700, SIGN | {"hand": "other"})], [[[3150, NO_SIGN]], False]),
        ([(100, DOWN), (3200, SIGN)], [[[3150, NO_SIGN]], False]),
        ([(100, DOWN), (200, DOWN)], [[], False]),
        ([(100, DOWN), (200, DOWN | {"hand": "other"})], [[[3150, NO_SIGN]], False]),
    ],
)
def test_hand_counts_as_long_as_its_last_sign_of_life(page: Any, script: Any, expected: Any) -> None:
    assert page.evaluate(SIGNS, script) == expected
