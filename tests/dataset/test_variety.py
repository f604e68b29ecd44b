"""Measures of language, on texts whose figures can be counted by hand."""

import pytest

from aerialdojo_gen.dataset.stats.variety import frame_of, measure, read_variety, self_bleu, variety_table, words_of

TEXTS = ("A red van stands by the hut.", "A red van stands by the gate.", "Look for the blue tent. It has a door.")


def test_counts():
    found = measure(TEXTS, [1, 2, 3])
    assert (found.texts, found.words, found.lengths) == (3, 23, (7, 7, 9))
    assert found.vocabulary == len({"a", "red", "van", "stands", "by", "the", "hut", "gate", "look", "for", "blue",
                                    "tent", "it", "has", "door"})  # fmt: skip
    assert found.openings == pytest.approx(2 / 3)
    # Two texts of one object may begin alike.
    assert measure(TEXTS, [1, 1, 3]).openings == 0
    assert found.distinct[3] == pytest.approx((4 + 1 + 6) / (4 + 4 + 6))


def test_frames_keep_what_holds_a_sentence_together():
    assert frame_of(TEXTS[0]) == frame_of(TEXTS[1]) == "_ V _ ."
    assert frame_of(TEXTS[2]) == "look _ . it has _ ."
    assert measure(TEXTS, [1, 2, 3]).frames == 2
    assert measure(TEXTS, [1, 2, 3], ["x", "y", "z"]).frames == 3


def test_self_bleu_is_one_of_copies_and_little_of_strangers():
    copies, strangers = [words_of(TEXTS[0])] * 3, [words_of(text) for text in ("a b c d e", "f g h i j")]
    assert self_bleu(copies, [1, 2, 3]) == pytest.approx(1.0)
    assert self_bleu(strangers, [1, 2]) < 0.2


@pytest.mark.pipeline
def test_a_release_is_measured_by_level(smoke):
    found = read_variety(smoke, ["U_Courtyard_0", "U_Courtyard_1"])
    assert set(found) == {"all", "one an object", "terse", "normal", "detailed", "vague"}
    assert found["all"].texts > found["one an object"].texts > 0
    assert "self-BLEU-4" in "\n".join(variety_table(found).markdown())
