"""Components of interactions at three levels."""

import re

import rsmkit as rk
from catalogue.answers import REPORTED, Answer, reported
from catalogue.designs import settings_of
from catalogue.runs import coded_runs, table_of


def _plain(word: str) -> str:
    """A word as rsmkit writes it: letters in order, the first exponent one."""
    return rk.component_relation([word])[0]


def _words(printed) -> set[str]:
    text = str(printed).translate(str.maketrans("\N{SUPERSCRIPT TWO}", "2")).replace(" ", "")
    return {_plain(part) for part in re.split(r"[,=]|and", text) if part and part != "I"}


def _design(settings):
    space = rk.Space([rk.Factor(str(name), -1.0, 1.0) for name in settings])
    centred = settings.rank(method="dense") - 2.0  # levels 0, 1, 2 in order, whatever they are called
    return rk.Design(space, centred.to_numpy(float), ("given",) * len(settings))


def sums(fits, check: dict) -> Answer:
    """Sum of squares of a component, or the totals of its three values."""
    settings, responses = coded_runs(fits.entry, check)
    y = responses[check.get("response") or responses.columns[0]].to_numpy(float)
    settings = settings[check["factors"]] if check.get("factors") else settings
    by_name = not check.get("factors") and set(re.findall("[A-Za-z]", check["word"])) <= set(settings)
    letters = dict(zip(settings, settings if by_name else "ABCDEFGHJ", strict=False))
    settings = settings.loc[:, settings.nunique() > 1]  # parts of a table hold other factors at one level
    again = {letters[name]: "ABCDEFGHJ"[place] for place, name in enumerate(settings)}
    word, names = "".join(again.get(x, x) for x in check["word"]), list(settings.columns)
    rows = rk.interaction_components(_design(settings), y, order=len(names))
    row = next(r for r in rows if r.word == _plain(word))
    key = check.get("key", "ss")
    return reported(row.ss if key == "ss" else row.totals[int(key.split(".")[1])])


def product(entry: dict, check: dict, printed) -> Answer:
    """A product of two components: one of those that go with both."""
    found = set(rk.component_relation(check["words"])) - {_plain(word) for word in check["words"]}
    wanted = _words(printed)
    return Answer(", ".join(sorted(found)), REPORTED, wanted <= found)


def relation(entry: dict, check: dict, printed) -> Answer:
    """All components of a defining relation, or its shortest word."""
    found = rk.component_relation(check["words"])
    if check.get("key") == "resolution":
        size = min(len(re.sub("2", "", word)) for word in found)
        return Answer(str(size), REPORTED, {"III": 3, "IV": 4, "V": 5}[str(printed).strip()] == size)
    return Answer(", ".join(found), REPORTED, _words(printed) == set(found))


def blocks(entry: dict, check: dict, printed) -> Answer:
    """Whether the printed blocks are those of the components."""
    settings = settings_of(entry, check)
    labels = table_of(entry, check.get("runs"))[check["block"]].astype(str)
    settings = settings.drop(columns=check["block"], errors="ignore")
    mine = rk.three_level_blocks(_design(settings), check["words"]).blocks
    pairs = set(zip(mine, labels, strict=True))
    same = len(pairs) == len(set(mine)) == len(set(labels))
    return Answer(f"{len(set(mine))} blocks", REPORTED, same)


def fraction(entry: dict, check: dict, printed) -> Answer:
    """Whether the entry's runs are those of the fraction."""
    settings = settings_of(entry, check)
    design = _design(settings)
    mine = rk.three_level_fraction(design.space, check["words"], check["u"])
    ours, theirs = (set(map(tuple, each.coded.tolist())) for each in (mine, design))
    same = ours == theirs if len(ours) == len(theirs) else theirs <= ours  # one of several generators
    return Answer(f"{len(mine)} runs", REPORTED, same)


KINDS = {
    "component_product": product,
    "component_relation": relation,
    "component_blocks": blocks,
    "component_fraction": fraction,
}
