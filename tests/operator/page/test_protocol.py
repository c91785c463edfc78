from __future__ import annotations

import json
import math
import os
import random
import sys
import time
from collections.abc import Iterator, Sequence

import pytest

from deploy.operator.page.protocol import (
    LIMITS,
    PROGRAMS,
    Beat,
    Engines,
    Fault,
    FollowScenario,
    Hello,
    Message,
    Press,
    Process,
    ProtocolError,
    Release,
    Set,
    parse,
)

GOOD: list[tuple[str, Message]] = [
    ('{"type": "hello", "token": "s3cr3t"}', Hello("s3cr3t")),
    ('{"type": "press", "nonce": "00ff"}', Press("00ff")),
    ('{"type": "beat", "nonce": ""}', Beat("")),
    ('{"type": "release"}', Release()),
    ('{"type": "engines", "command": "turn_on"}', Engines("turn_on")),
    ('{"command": "turn_off", "type": "engines"}', Engines("turn_off")),
    ('{"type": "set", "name": "l1", "value": 2}', Set("l1", 2.0)),
    ('{"type": "set", "name": "theta2", "value": -1.5}', Set("theta2", -1.5)),
    ('{"type": "follow_scenario"}', FollowScenario()),
    ('{"type": "fault", "text": "a is not defined"}', Fault("a is not defined")),
    ('{"type": "process", "name": "kinematics", "action": "kill"}', Process("kinematics", "kill")),
    ('{"type": "process", "name": "sentinel", "action": "stop"}', Process("sentinel", "stop")),
]
BAD = [
    "",
    "beat",
    "null",
    "1",
    "[]",
    '"beat"',
    "{}",
    '{"type": null}',
    '{"type": "welcome"}',
    '{"type": ["beat"], "nonce": "1"}',
    '{"type": "beat"}',
    '{"type": "beat", "nonce": 1}',
    '{"type": "beat", "nonce": null}',
    '{"type": "fault", "text": 1}',
    '{"type": "fault"}',
    '{"type": "beat", "nonce": "1", "more": 1}',
    '{"type": "beat", "nonce": "1", "nonce": "2"}',
    '{"type": "beat", "nonce": "1"} ?',
    '{"type": "beat", "nonce": "\\ud800"}',
    json.dumps({"type": "beat", "nonce": "n" * 65}),
    json.dumps({"type": "hello", "token": "t" * 2000}),
    '{"type": "engines", "command": "on"}',
    '{"type": "engines", "command": ["turn_on"]}',
    '{"type": "set", "name": "l3", "value": 1}',
    '{"type": "set", "name": "l1", "value": -1}',
    '{"type": "set", "name": "l1", "value": 1000.1}',
    '{"type": "set", "name": "l1", "value": NaN}',
    '{"type": "set", "name": "l1", "value": Infinity}',
    '{"type": "set", "name": "l1", "value": 1e999}',
    '{"type": "set", "name": "l1", "value": "1"}',
    '{"type": "set", "name": "l1", "value": true}',
    '{"type": "set", "name": "l1", "value": null}',
    f'{{"type": "set", "name": "l1", "value": 1{"0" * 500}}}',
    '{"type": "process", "name": "bash", "action": "kill"}',
    '{"type": "process", "name": "kinematics", "action": "run"}',
    '{"type": "process", "pid": 1, "action": "kill"}',
    "[" * 1000,
    '{"type":' * 120,
]


@pytest.mark.parametrize(("text", "message"), GOOD)
def test_messages_of_the_protocol_are_accepted(text: str, message: Message) -> None:
    assert repr(parse(text)) == repr(message), "with a number of the same type"


@pytest.mark.parametrize("text", [*BAD, b'{"type": "release"}'])
def test_other_messages_are_refused(text: str | bytes) -> None:
    with pytest.raises(ProtocolError):
        parse(text)


def _is_within_the_protocol(message: Message) -> bool:
    match message:
        case Hello(word) | Press(word) | Beat(word):
            return isinstance(word, str) and len(word) <= 64 and word.isascii()
        case Engines(command):
            return command in ("turn_on", "turn_off")
        case Set(name, value):
            return math.isfinite(value) and LIMITS[name][0] <= value <= LIMITS[name][1]
        case Fault(text):
            return isinstance(text, str)
        case Process(name, action):
            return name in PROGRAMS and action in ("kill", "stop")
    return message in (Release(), FollowScenario())


def noise(texts: Sequence[str], count: int, seed: str) -> Iterator[str]:
    """Yield random messages, most of them almost those of a page."""
    chance = random.Random(seed)
    parts = [
        *(repr(word) for text in texts if text.startswith("{") for word in text.split('"')[1::2] if word),
        *("0", "-1", "1e308", "-0.0", "1e-999", "true", "null", "[]", "{}", "NaN", "9" * 400),
        *('"\\u0000"', '"ä"'),
    ]
    parts = [part.replace("'", '"') for part in parts]
    for number in range(count):
        match number % 4:
            case 0:
                yield chance.randbytes(chance.randrange(1, 60)).decode("latin-1")
            case 1 | 2:
                text = chance.choice(texts)
                at = chance.randrange(len(text) + 1)
                new = chr(chance.randrange(0x250)) * chance.randrange(3)
                yield text[:at] + new + text[at + chance.randrange(4) :]
            case 3:
                keys = chance.choices(parts, k=chance.randrange(1, 4))
                yield "{" + ",".join(f"{key}:{chance.choice(parts)}" for key in keys) + "}"


def test_random_messages_do_nothing_else() -> None:
    seed = os.environ.get("FUZZ_SEED") or str(time.time_ns())
    inputs = int(os.environ.get("FUZZ_INPUTS", "40000"))  # `.ci/run` feeds a million
    accepted = blocks = 0
    for number, text in enumerate(noise([text for text, _ in GOOD] + BAD, inputs, seed)):
        if number == inputs // 10:
            blocks = sys.getallocatedblocks()
        try:
            message = parse(text)
        except ProtocolError:
            continue
        accepted += 1
        assert _is_within_the_protocol(message), f"FUZZ_SEED={seed}: {text!r}"

    assert inputs / 1000 < accepted < inputs / 2, f"FUZZ_SEED={seed}: the noise misses the protocol"
    assert sys.getallocatedblocks() < blocks + 5000, f"FUZZ_SEED={seed}: memory leaks"
