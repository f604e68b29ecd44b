"""Measures of language, on texts whose figures can be counted by hand."""

import pytest

from aerialdojo_gen.dataset.stats.variety import measure, read_variety, self_bleu, variety_table, words_of

TEXTS = ("A red van stands by the hut.", "A red van stands by the gate.", "Look for the blue tent. It has a door.")


def test_counts():
    found = measure(TEXTS, [1, 2, 3], ["x", "x", "y"])
    assert (found["texts"], found["words"], found["vocabulary"]) == ("3", "23", "15")
    assert found["fewest, median, most words"] == "7, 7, 9"
    assert (found["frames"], found["most common frame"]) == ("2", "66.67%")
    assert found["first four words shared"] == "66.7%"
    # Two texts of one object may begin alike.
    assert measure(TEXTS, [1, 1, 3], "xyz")["first four words shared"] == "0.0%"
    share = (4 + 1 + 6) / (4 + 4 + 6)
    assert found["distinct 1-, 2-, 3- and 4-grams"].endswith(f", {share:.3f}")


def test_self_bleu_is_one_of_copies_and_little_of_strangers():
    copies, strangers = [words_of(TEXTS[0])] * 3, [words_of(text) for text in ("a b c d e", "f g h i j")]
    assert self_bleu(copies, [1, 2, 3]) == pytest.approx(1.0)
    assert self_bleu(strangers, [1, 2]) < 0.2


@pytest.mark.pipeline
def test_a_release_is_measured_by_level(smoke):
    found = read_variety(smoke, ["U_Courtyard_0", "U_Courtyard_1"])
    assert set(found) == {"all", "one an object", "terse", "normal", "detailed", "vague"}
    assert int(found["all"]["texts"]) > int(found["one an object"]["texts"]) > 0
    assert "self-BLEU-4" in "\n".join(variety_table(found).markdown())
