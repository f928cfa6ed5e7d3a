"""Questions about regular fractions: generators, defining relation, aliases."""

import functools
import math
import re
from collections import Counter
from itertools import chain

from catalogue.answers import REPORTED, ROMAN, WORKED, Answer, NotThereError
from rsmkit import confounded_effects
from rsmkit.design.families.two_level.factorial import LETTERS, STANDARD, fraction, standard_generators

MOST_EFFECTS = 4_000_000
"""Effects times words up to which the whole table of aliases is asked for."""


def plain(word: str) -> str:
    return re.sub(r"[\s·×*]", "", str(word).replace("\N{MINUS SIGN}", "-"))


def letters_of(word: str) -> str:
    """A word with its letters in order; nothing for the mean."""
    text = plain(word)
    return "" if text in ("I", "Intercept") else "".join(sorted(text))


def listed(printed) -> list[str]:
    """The words of a printed list or chain of aliases."""
    found = (letters_of(part) for part in re.split(r"[,=+]|\band\b", str(printed)))
    return [word for word in found if word]


def product(*words: str) -> str:
    """Product of words; a letter, or a sign, twice is none."""
    letters = list(chain.from_iterable(words))
    return "".join(x for x in sorted(set(letters)) if letters.count(x) % 2)


def factors_of(check: dict, entry: dict) -> tuple[str, ...]:
    count = check.get("k") or len(entry.get("factors") or [])
    return tuple(check.get("factors") or LETTERS[:count])


def generators_of(check: dict, names: tuple[str, ...]) -> tuple[str, ...]:
    """The generators that are given, or those of the standard fraction that is named."""
    k = len(names)
    if check.get("generators") is not None:
        return tuple(check["generators"])
    if check.get("resolution"):
        sizes = sorted((p for factors, p in STANDARD if factors == k), reverse=True)
        good = (p for p in sizes if fraction(k, standard_generators(k, p)).resolution >= check["resolution"])
        generated = next(good, 0)
        if not generated and check["resolution"] <= k and (k, 1) not in STANDARD:
            raise NotThereError("a standard fraction that is not in the table")
    else:
        generated = k - round(math.log2(int(check.get("n_runs") or 2 ** (k - 1))))
    if generated and (k, generated) not in STANDARD:
        raise NotThereError("a standard fraction that is not in the table")
    name = dict(zip(LETTERS, names, strict=False))
    texts = (text.partition("=") for text in standard_generators(k, generated))
    return tuple(name[left] + "=" + "".join(name[x] for x in right) for left, _, right in texts)


@functools.cache
def made(names: tuple[str, ...], generators: tuple[str, ...]):
    """The fraction in rsmkit's letters, and both translations."""
    texts = [plain(g).partition("=") for g in generators]
    right = {left: word for left, _, word in texts}
    for _ in right:  # a generator may use a generated factor
        for left, word in right.items():
            inside = next((x for x in word.lstrip("-") if x in right and x != left), None)
            if inside:
                right[left] = product(word.replace(inside, "", 1), right[inside])
    order = [n for n in names if n not in right] + [n for n in names if n in right]
    if len(order) > len(LETTERS):
        raise NotThereError("fractions of more than 25 factors")
    own = dict(zip(order, LETTERS, strict=False))
    words = {
        own[left]: ("-" if "-" in word else "") + "".join(sorted(own[x] for x in word if x != "-"))
        for left, word in right.items()
    }
    found = fraction(len(order), [f"{left}={words[left]}" for left in sorted(words, key=LETTERS.index)])
    return found, own, {letter: name for name, letter in own.items()}


def translated(word: str, table: dict) -> str:
    sign = "-" if word.startswith("-") else ""
    return "".join(sorted(sign + "".join(table[x] for x in word.lstrip("-"))))


@functools.cache
def aliases_up_to(names, generators, order: int) -> dict:
    return made(names, generators)[0].aliases(order)


def answer(entry: dict, check: dict, printed: str) -> Answer:
    """A question about a fraction, compared with what is printed."""
    names = factors_of(check, entry)
    generators = generators_of(check, names)
    found, _, back = made(names, generators)
    words = sorted(translated(w, back) for w in found.words)
    kind = check["kind"]
    if kind == "generator":
        mine = sorted(translated("".join(sorted(plain(g).replace("=", ""))), back) for g in found.generators)
        wanted = product(*(letters_of(side) for side in plain(printed).split("=")))
        return Answer(", ".join(mine), REPORTED, wanted in mine)
    if kind == "resolution":
        return Answer(str(found.resolution), REPORTED, ROMAN.get(printed.strip()) == found.resolution)
    if kind == "defining_relation":
        return Answer(", ".join(words), REPORTED, sorted(listed(printed)) == words)
    if kind == "word_lengths":
        mine = Counter(found.word_lengths)
        return Answer(str(mine), REPORTED, Counter(map(int, re.findall(r"\d+", printed))) == mine)
    if kind == "minimum_aberration":
        if (len(names), len(generators)) not in STANDARD:
            raise NotThereError("a standard fraction that is not in the table")
        best = fraction(len(names), standard_generators(len(names), len(generators)))
        return Answer(" ".join(best.generators), REPORTED, best.word_lengths == found.word_lengths)
    if kind == "block_effects":
        return confounded_with_blocks(words, check, printed)
    return _aliases(check, printed, names, generators, words)


def _aliases(check, printed, names, generators, words) -> Answer:
    _, own, back = made(names, generators)
    term = letters_of(check["term"])
    wanted = set(listed(printed)) - {term}
    longest = max((len(w.lstrip("-")) for w in wanted), default=1)
    up_to = check.get("up_to", 2 if check["kind"] == "clear" else longest)
    order = max(up_to, len(term.lstrip("-")))
    effects = sum(math.comb(len(names), i) for i in range(order + 1))
    if effects * max(1, len(words)) <= MOST_EFFECTS:
        mine = "".join(sorted(own[x] for x in term.lstrip("-"))) or "I"
        aliases = [
            a.replace("I", "") if a in ("I", "-I") else a
            for a in aliases_up_to(names, generators, order)[mine]
        ]
        if term.startswith("-"):
            aliases = [a[1:] if a.startswith("-") else "-" + a for a in aliases]
        known, how = {translated(a, back) for a in aliases}, REPORTED
    else:
        known, how = {product(term, w) for w in words}, WORKED
    if check["kind"] == "clear":
        short = [a for a in known if 0 < len(a.lstrip("-")) <= 2]
        return Answer(", ".join(short), how, not short)
    if "up_to" in check:
        short = {a for a in known if 0 < len(a.lstrip("-")) <= check["up_to"]}
        return Answer(", ".join(sorted(short)), how, wanted == short)
    return Answer(", ".join(sorted(known))[:80], how, bool(wanted) and wanted <= known)


def confounded_with_blocks(words, check, printed) -> Answer:
    """The chains of aliases that blocks take."""
    found = {frozenset(chain) for chain in confounded_effects(listed(check["of"]), words)}
    bare = [word.lstrip("-") for word in words]
    printed_chains = {
        frozenset(product(word.lstrip("-"), other) for other in ["", *bare]) for word in listed(printed)
    }
    return Answer(
        ", ".join(min(c, key=lambda w: (len(w), w)) for c in found), REPORTED, printed_chains == found
    )


def of_blocks(check: dict, printed, words=(), relation=()) -> Answer:
    """All effects that blocks take from a factorial, or as many of each length as are printed."""
    wanted = listed(printed)
    if check["kind"] == "generalized_interactions":
        found = [chain[0] for chain in confounded_effects(listed(check["of"]))]
        return Answer(", ".join(found), REPORTED, len(wanted) == len(found) and set(wanted) == set(found))
    found = [chain[0] for chain in confounded_effects(words, relation)]
    return Answer(", ".join(found), REPORTED, sorted(map(len, wanted)) == sorted(map(len, found)))
