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
        const common = { host: "", restarts: 0, output: 0, health: "good" };
        table.render({ processes: [{ ...common, name: "velocity", state, pid, ok }], welcome, time }, true);
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
    const process = { name: "velocity", state: "RUNNING", pid: 7, restarts: 0, ok: true, output: 0 };
    return ["", "robot1", "robot1, robot2", ""].map((host) => {
        table.render({ processes: [{ ...process, host }], time: 0 }, true);
        return document.querySelector("tr[data-process=velocity] th").innerText.trim();
    });
}
"""

LOCAL = """
async () => {
    const { Processes } = await import("/static/processes.js");
    const table = new Processes(() => true);
    return [true, false].map((local) => {
        table.render({ processes: [], welcome: { programs: ["velocity"], local }, time: 0 }, true);
        return document.querySelector("#processes [data-action=kill]").checkVisibility();
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
        const joints = { l1: 1, l2: 1, theta1, theta2 };
        const known = { position: null, unheard: [], trace, time: 0, speed: 0, engines: { state: "on" } };
        arm.render({ arm: joints, ...known }, true);
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
    const again = JSON.stringify(shown()) === opened;
    const off = { ...past, operator: { ...operator, strikes_left: 0 }, engines: { state: "off" } };
    model.begin({ ...welcome, history: [[25, past], [33, off]] }); // after sleep
    model.update({ ...now, time: 40, operator: off.operator });
    return [JSON.parse(opened), again, shown().map((it) => it.slice(-2))];
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

BUTTON = """
async () => {
    const { words, fuse, holdState } = await import("/static/hold_button.js");
    const shown = (hold, state, stops_in) => words(hold, { state, stops_in }, 10.5).join(" | ");
    const welcome = { strikes: 3, silence: 3, presence_timeout: 10 };
    const left = (state, stops_in) => fuse({ engines: { state, stops_in }, welcome });
    return [
        [
            shown("released", "off", null), shown("held", "off", null), shown("held", "on", 9),
            shown("held", "on", 2.5), shown("released", "on", 2.5), shown("released", "on", null),
            shown("released", "on", 0), shown("dead_mans_switch", "on", 9), shown("other_page", "off", null),
            shown("held", null, null),
        ],
        [left("on", 9), left("on", 3), left("on", 0), left("on", null), left("off", null)],
        ["this_page", "other_page", null].map((by) => holdState(true, { held: false }, { held: true, by })),
    ];
}
"""
BUTTON_TOLD = [
    "Hold | Engines off. Press and hold here.",
    "Held, now turn on | Press Enter, or use a second finger.",
    "ENGINES ON | Let go: off in 9 s, or 10.5\u00a0s if programs crash.",
    "ENGINES ON | Let go: off in 3 s, or 10.5\u00a0s if programs crash.",
    "Stops in 3 s, hold to keep | Released, engines on.",
    "Stops soon, hold to keep | Released, engines on.",
    "Stops now | Released. Hold and turn on again.",
    "ENGINES ON | The scenario holds. Hold here to take over.",
    "Held on another page | Another page holds. Only one can.",
    "Held | No word from the engine controller.",
]

FAIL_SAFES = """
async () => {
    const { failSafe } = await import("/static/chain.js");
    const welcome = { presence_timeout: 10, on_lasts: 0.4 };
    const shown = (state, held, without, stops_in = 8.2, age = 0.3) => failSafe(
        { operator: { age }, engines: { state, stops_in }, switch: { held }, welcome }, without,
    ).join(": ");
    return [
        shown("on", true), shown("on", false), shown("on", false, "", null), shown("on", true, "watchdog"),
        shown("on", true, "watchdog", null, null), shown("off", true, "watchdog"),
        shown("on", true, "controller"), shown(null, true), shown("off", false), shown("on", true, "drive"),
        shown("on", true, "arm"),
    ];
}
"""
FAIL_SAFES_TOLD = [
    "watchdog: Let go, and the watchdog turns the engines off in 9 s.",
    "watchdog: Nobody holds: the watchdog turns the engines off in 9 s.",
    "watchdog: Nobody holds: the watchdog turns the engines off soon.",
    "controller: Without the watchdog, the controller turns the engines off in 10 s.",
    "controller: Without the watchdog, the controller turns the engines off 10 s later.",
    "controller: Without the watchdog, the controller turns the engines off 10 s later.",
    "drive: Without the controller, the drive stands still after 0.4 s.",
    "drive: Without the controller, the drive stands still after 0.4 s.",
    "drive: The engines are off: the drive moves nothing.",
    "arm: Without the drive, nothing moves the joints.",
    "watchdog: The engines do not need this process. Without it, nobody knows where the arm is.",
]

AWAY = """
async () => {
    const { Away } = await import("/static/chain.js");
    const shown = (script) => {
        const away = new Away();
        for (const [time, pid, output, state = "RUNNING", ok = true] of script) {
            if (pid === "kill") away.kill(time);
            else away.see({ pid, output, ok, state }, time);
        }
        return [away.since !== null, away.words];
    };
    const before = [[9.9, 7, 9.8], [10, "kill"]];
    return [
        shown(before),
        shown([...before, [10.1, 7, 10.02]]), // sent before it died
        shown([...before, [10.1, 8, 10.02, "STARTING"]]),
        shown([...before, [10.1, 8, 10.02, "STARTING"], [10.5, 8, 10.45, "STARTING"]]),
        shown([...before, [11.5, 8, null]]), // alive, and has nothing to say
        shown([[9.9, 7, 9.8], [10.1, 8, 9.8, "STARTING"], [10.5, 8, 10.45, "STARTING"]]), // killed
        shown([[9.9, 7, 9.8], [13, 7, 9.8, "RUNNING", false]]), // hangs
    ];
}
"""

REPLAY = """
async () => {
    const { Rewind } = await import("/static/rewind.js");
    const { Model } = await import("/static/model.js");
    const rewind = new Rewind();
    const model = new Model();
    const past = (held, state) => ({
        operator: { seen: true, age: 0, activity: null, strikes_left: 3 },
        switch: { held, by: held ? "this_page" : null }, engines: { state, why: "turned off by terminal" },
    });
    model.begin({ strikes: 3 });
    for (let time = 0; time <= 300; time += 1) {
        const trace = [[time / 10, time, 0, 1, time / 100, null]];
        const now = past(time < 180, time < 200 ? "on" : "off");
        model.update({ time: time / 10, arm: { l1: 1, l2: 1 }, trace, ...now });
        rewind.note(model);
        rewind.allow(true);
        if (time === 209 && !document.getElementById("rewind").hidden) return "too early";
    }
    const button = document.getElementById("rewind");
    const began = performance.now();
    performance.now = () => began; // a busy machine delays nothing
    button.click();
    delete performance.now;
    const shown = (seconds) => {
        const frame = rewind.frame(began + 1000 * seconds + 1);
        const note = document.getElementById("replay-note").textContent;
        return frame && [frame.position.x, frame.arm.theta1, frame.switch.held, frame.engines.state, note];
    };
    const { dataset } = document.documentElement;
    const seen = [shown(2), shown(8.5), shown(10.5), shown(12), dataset.replay ?? null];
    rewind.allow(false);
    const whileOn = button.hidden;
    const later = [];
    for (const time of [301, 320, 325, 331]) {
        model.update({ time: time / 10, arm: {}, trace: [], ...past(true, time < 320 ? "on" : "off") });
        rewind.note(model);
        rewind.allow(true);
        later.push(button.hidden);
    }
    return [...seen, whileOn, later];
}
"""

LOST = """
async () => {
    const { withoutUs } = await import("/static/status.js");
    const welcome = { off_within: 10.5 };
    const since = new Date(2026, 0, 1, 22, 46, 40);
    const shown = (state, by, age, seconds) => withoutUs(
        { engines: { state }, switch: { held: by !== null, by }, operator: { age }, welcome },
        since, since.getTime() + 1000 * seconds,
    );
    return [
        shown("on", "this_page", 0.1, 1),
        shown("on", null, 4.2, 1),
        shown("on", "this_page", 0.1, 11),
        shown("on", "terminal", 0.1, 1),
        shown("off", null, null, 1),
        shown(null, null, null, 1),
    ];
}
"""

STRIKES = """
async () => {
    const { Operator } = await import("/static/operator.js");
    const operator = new Operator();
    const welcome = { strikes: 3, silence: 3, presence_timeout: 10 };
    return [3, 1, 0].map((left) => {
        const seen = { seen: true, age: 0, activity: "alive", strikes_left: left };
        operator.render({ operator: seen, welcome, switch: {} });
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
        operator.render({ operator: { seen, age: 0, activity: null, strikes_left: null }, switch: {} });
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
    return [seen, state.held, state.why];
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


def test_page_of_another_host_has_no_buttons_to_kill(page: Any) -> None:
    assert page.evaluate(LOCAL) == [True, False]


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
    asleep = [hands[-2:], [[25, 1], [33, 3]], engines[-2:]]
    assert page.evaluate(HISTORY) == [[hands, strikes, engines], True, asleep]


def test_positions_are_hidden_until_they_are_wanted_and_push_out_nothing(page: Any) -> None:
    assert page.evaluate(EVENTS) == [["[2] died", "[1] off"], ["[2] died"], 201]


def test_strikes_are_told_as_strikes_that_are_left(page: Any) -> None:
    assert page.evaluate(STRIKES) == [
        ["3 of 3 strikes left", "3 strikes left"],
        ["1 of 3 strikes left", "1 strike left"],
        ["0 of 3 strikes left", "0 strikes left"],
    ]


def test_button_tells_what_the_engines_do_and_what_happens_without_the_hand(page: Any) -> None:
    assert page.evaluate(BUTTON) == [
        BUTTON_TOLD,
        [1, 1 / 3, 0, 0, 0],
        ["releasing", "other_page", "somebody"],
    ]


def test_chain_tells_who_makes_the_arm_safe_without_a_node(page: Any) -> None:
    assert page.evaluate(FAIL_SAFES) == FAIL_SAFES_TOLD


def test_node_tells_how_long_it_was_away(page: Any) -> None:
    gone, back = [True, ""], [False, "back in 0.45 s"]
    silent, killed = [False, "back within 1.50 s"], [False, "back within 0.65 s"]
    assert page.evaluate(AWAY) == [gone, gone, gone, back, silent, killed, gone]


def test_replay_shows_the_ten_seconds_before_the_stop(page: Any) -> None:
    before = "Replay: {} s before the engines stopped."
    assert page.evaluate(REPLAY) == [
        [120, 1.2, True, "on", before.format("8.0")],
        [185, 1.85, False, "on", before.format("1.5")],
        [205, 2.05, False, "off", "Replay: Turned off by terminal."],
        None,
        None,
        True,
        [False, True, True, False],
    ]


def test_lost_page_tells_what_the_robot_does_by_itself(page: Any) -> None:
    by = "The engines stop by 22:46:{} at the latest, unless another hand holds."
    unknown = "What the engines do is unknown."
    was_off = "The engines were off. What they do now is unknown."
    assert page.evaluate(LOST) == [by.format(51), by.format(47), unknown, unknown, was_off, unknown]


def test_first_state_of_the_operator_is_no_alarm(page: Any) -> None:
    assert page.evaluate(ALERTS) == ["", "", "", "Operator not seen."]


DOWN = {"type": "down", "hand": "key", "lasts": 3000, "lack": "no sign"}
SIGN = {"type": "sign", "hand": "key", "lasts": 500, "lack": "no sign"}
NO_SIGN = "Released: no sign"


@pytest.mark.parametrize(
    ("script", "ends"),
    [
        ([(100, {"type": "down", "hand": "mouse"})], None),
        ([(100, DOWN)], 3150),
        ([(100, DOWN), (700, SIGN)], 1250),
        ([(100, DOWN), *((at, SIGN) for at in range(700, 12000, 500))], None),
        ([(100, DOWN), (700, SIGN), (750, SIGN | {"lasts": 9000})], 9800),
        ([(100, DOWN), (700, SIGN | {"hand": "other"})], 3150),
        ([(100, DOWN), (3200, SIGN)], 3150),
        ([(100, DOWN), (200, DOWN | {"hand": "other"})], 3150),
    ],
)
def test_hand_counts_as_long_as_its_last_sign_of_life(page: Any, script: Any, ends: int | None) -> None:
    lost = [[ends, NO_SIGN]] if ends else []
    assert page.evaluate(SIGNS, script) == [lost, not ends, NO_SIGN if ends else ""]


@pytest.mark.parametrize(
    ("event", "why"),
    [
        (DOWN, "Released: it was let go unnoticed, and pressed again"),
        ({"type": "refused", "why": "another page holds"}, "Not held: another page holds"),
        ({"type": "released", "why": "a beat came late"}, "Released: a beat came late"),
    ],
)
def test_hold_ends_for_a_reason(page: Any, event: Any, why: str) -> None:
    assert page.evaluate(SIGNS, [(100, DOWN), (200, event)]) == [[], False, why]
