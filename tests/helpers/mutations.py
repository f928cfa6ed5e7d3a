"""Damage to files: what disks, editors and attackers do to them."""

import copy
import json
import random

NASTY_BYTES = [
    b"NaN",
    b"1e999",
    b"-Infinity",
    b"null",
    b"[" * 3000,
    b'{"a":' * 2000,
    b"9" * 5000,
    b"\0" * 100,
    b"\xff\xfe",
    b'"key":"../../../../etc/passwd",',
    b'"__class__":"os.system",',
    b'"schema":1e0,',
    b"\\ud800",
    b"\xe2\x80\xa8",
    b"\x85",
    b'"responses":{"y":true},',
    b"{}\n",
    b"\n\n",
    b"\r\n",
    b"\xef\xbb\xbf",
    b"<script>alert(1)</script>",
    b"\x1b[31m",
    b"a" * 20000,
    b"'''",
    b'"""',
    b"a.b.c = 1\n",
    b"[a.b]\n",
    b"[[search]]\n",
    b"a." * 3000 + b"b = 1\n",
    b"nan",
    b"inf",
    b"0x7fffffffffffffffffff",
    b"1979-05-27T07:32:00Z",
]

NASTY_VALUES = [
    None,
    True,
    False,
    0,
    -1,
    1,
    2,
    3,
    10**9,
    2**63,
    -(2**63),
    10**400,
    0.0,
    -0.0,
    1e308,
    -1e308,
    5e-324,
    0.5,
    1e-300,
    float("nan"),
    float("inf"),
    float("-inf"),
    "",
    " ",
    "x",
    "1",
    "nan",
    "../../etc/passwd",
    "/etc/passwd",
    "..",
    "a\0b",
    "\u2028",
    "\ud83d\ude00",
    "<img src=x onerror=alert(1)>",
    "{a}",
    "{a.__class__}",
    "%s%n",
    "a" * 5000,
    "9**9**9",
    "9**9**9**9",
    "(" * 500 + ")" * 500,
    "__import__('os').system('touch hacked')",
    "lambda: 0",
    "1e999",
    "0*" * 300 + "1",
    "(a+)+$",
    "(x+x+)+y",
    "(?P<a>x",
    "x" * 2500,
    "os:system",
    "builtins:exec",
    "../evil:f",
    "e\u0301",
    "\x1b[2J",
    "\r\n",
    "pi",
    "None",
    [],
    [[]],
    [1],
    ["x"],
    [None],
    [float("nan")],
    list(range(50)),
    [[1, 2], [3]],
    [[[[[[]]]]]],
    {},
    {"": 1},
    {"a": {}},
    {"x": []},
    {"__proto__": 1},
    {"low": 1, "high": 0},
    {"low": -1e308, "high": 1e308},
    {"low": 1, "high": 1.0000000000000002},
    {"levels": ["a", "a"]},
    {"levels": [1, "a"]},
    {"levels": []},
    {"integer": True, "low": 0.5, "high": 3},
]


def mutate_bytes(data: bytes, rng: random.Random) -> bytes:
    """Change a file byte by byte, or piece by piece."""
    damaged = bytearray(data)
    for _ in range(rng.choice([1, 1, 1, 2, 5, 50])):
        where = rng.randrange(len(damaged) + 1)
        match rng.randrange(7):
            case 0 if where < len(damaged):
                damaged[where] = rng.randrange(256)
            case 1 if where < len(damaged):
                damaged[where] ^= 1 << rng.randrange(8)
            case 2:
                del damaged[where : where + rng.randrange(40)]
            case 3:
                damaged[where:where] = rng.randbytes(rng.randrange(1, 9))
            case 4:
                other = rng.randrange(len(damaged) + 1)
                damaged[where:where] = damaged[other : other + rng.randrange(200)]
            case 5:
                damaged[where:where] = rng.choice(NASTY_BYTES)
            case _:
                damaged[where:] = b""
    return bytes(damaged)


def mutate_document(document, rng: random.Random):
    """Change the values of a parsed document and keep its form."""
    document = copy.deepcopy(document)
    for _ in range(rng.choice([1, 1, 1, 2, 4])):
        places = list(_places(document))
        if not places:
            break
        container, key = rng.choice(places)
        match rng.randrange(8):
            case 0:
                del container[key]
            case 1 if isinstance(container, dict):
                container[rng.choice(["", "x", "a.b", "__class__", "../x", "schema", "name", "\0", "é"])] = (
                    container[key]
                )
            case 2:
                container[key] = copy.deepcopy(rng.choice([c[k] for c, k in places]))
            case 3 if isinstance(container[key], list) and container[key]:
                container[key] = container[key] * rng.choice([2, 100])
            case 4 if isinstance(container[key], int | float) and not isinstance(container[key], bool):
                container[key] = container[key] * rng.choice([-1, 0, 1e6, 1e-6, 1e300]) + rng.choice([0, 0.5])
            case _:
                container[key] = copy.deepcopy(rng.choice(NASTY_VALUES))
    return document


def _places(document):
    keys = list(document) if isinstance(document, dict) else range(len(document))
    for key in keys:
        yield document, key
        if isinstance(document[key], dict | list):
            yield from _places(document[key])


def toml_text(value, top=True) -> str:
    """A document as TOML; what TOML cannot say (null) becomes an empty text."""
    if isinstance(value, dict):
        pairs = [f"{json.dumps(str(k))} = {toml_text(v, False)}" for k, v in value.items()]
        return "\n".join(pairs) if top else "{ " + ", ".join(pairs) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(toml_text(v, False) for v in value) + "]"
    if isinstance(value, float):
        return repr(value)
    return '""' if value is None else json.dumps(value)
