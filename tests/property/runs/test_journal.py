"""Journals that were cut, mutated or never were journals."""

import random
from contextlib import suppress

from hypothesis import given, settings
from hypothesis import strategies as st
from mutations import mutate_bytes

from rsmkit.errors import RsmkitError
from rsmkit.runs.record.journal import Journal
from rsmkit.runs.record.run import Run, run_from_json, run_key, run_to_json

texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
numbers = st.floats(allow_nan=False, allow_infinity=False)
values = st.one_of(st.booleans(), st.integers(-(2**60), 2**60), numbers, texts)


@st.composite
def runs(draw):
    factors = draw(st.dictionaries(texts, values, max_size=3))
    options = draw(st.dictionaries(texts, st.one_of(values, st.lists(values, max_size=3)), max_size=3))
    replicate = draw(st.integers(0, 10**6))
    return Run(
        key=run_key("m:f", options, factors, replicate),
        simulator="m:f",
        settings=options,
        factors=factors,
        replicate=replicate,
        status=draw(st.sampled_from(["done", "failed", "timeout", "crashed"])),
        responses=draw(st.dictionaries(texts, numbers, max_size=3)),
        extras=draw(st.dictionaries(texts, st.one_of(st.none(), values), max_size=3)),
        seconds=draw(st.floats(0, 1e9)),
        attempt=draw(st.integers(1, 99)),
        error=draw(texts),
        host=draw(texts),
        started=draw(texts),
    )


@given(runs())
def test_every_run_comes_back_bit_by_bit(run):
    assert run_from_json(run_to_json(run)) == run


def example(index):
    return Run(
        f"{index:016x}", "m:f", {"s": 1.5}, {"a": index / 7}, 0, "done", {"y": index / 3}, {"n": "ä"}, 0.1
    )


def test_a_journal_cut_at_any_byte_loses_only_the_line_that_was_cut(tmp_path):
    journal = Journal(tmp_path / "runs.jsonl")
    records = [example(index) for index in range(3)]
    with journal:
        journal.append(records)
    whole = journal.path.read_bytes()
    ends = [index for index, byte in enumerate(whole) if byte == ord("\n")]
    for cut in range(len(whole) + 1):
        journal.path.write_bytes(whole[:cut])
        survivors = sum(end <= cut for end in ends)
        assert list(journal.load().values()) == records[:survivors], cut
        with journal:
            journal.append(example(9))
        assert list(journal.load().values()) == [*records[:survivors], example(9)], cut


def test_no_mutation_of_a_journal_gets_past_the_message_for_people(tmp_path):
    journal = Journal(tmp_path / "runs.jsonl")
    with journal:
        journal.append([example(index) for index in range(4)])
    whole = journal.path.read_bytes()
    rng = random.Random(20260101)
    refusals = []
    for _ in range(10_000):
        damaged = mutate_bytes(whole, rng)
        journal.path.write_bytes(damaged)
        try:
            for key, run in journal.load().items():
                assert len(key) == 16
                assert set(key) <= set("0123456789abcdef")
                assert all(isinstance(number, int | float) for number in run.responses.values())
                run_to_json(run)
        except RsmkitError as error:
            refusals.append(str(error))
    assert len(refusals) > 1000
    assert all("damaged" in text and len(text) < 600 for text in refusals)
    assert [path.name for path in tmp_path.iterdir()] == ["runs.jsonl"]


@settings(max_examples=300)
@given(st.binary(max_size=300))
def test_any_bytes_are_a_run_or_a_value_error(data):
    with suppress(ValueError):
        run_from_json(data)
