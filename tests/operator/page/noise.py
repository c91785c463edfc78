"""Random messages, most of them almost those of a page."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence


def noise(texts: Sequence[str], count: int, seed: str) -> Iterator[str]:
    chance = random.Random(seed)
    parts = [
        *(repr(word) for text in texts if text.startswith("{") for word in text.split('"')[1::2] if word),
        *(
            "0",
            "-1",
            "1e308",
            "-0.0",
            "1e-999",
            "true",
            "null",
            "[]",
            "{}",
            "NaN",
            "9" * 400,
            '"\\u0000"',
            '"ä"',
        ),
    ]
    parts = [part.replace("'", '"') for part in parts]
    for number in range(count):
        match number % 4:
            case 0:
                yield chance.randbytes(chance.randrange(1, 60)).decode("latin-1")
            case 1 | 2:
                text = chance.choice(texts)
                at = chance.randrange(len(text) + 1)
                yield (
                    text[:at]
                    + chr(chance.randrange(0x250)) * chance.randrange(3)
                    + text[at + chance.randrange(4) :]
                )
            case 3:
                keys = chance.choices(parts, k=chance.randrange(1, 4))
                yield "{" + ",".join(f"{key}:{chance.choice(parts)}" for key in keys) + "}"
