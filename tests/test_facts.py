"""The pages state the figures of `docs/facts.json`, and `make facts` writes them."""

import json
import re

import facts as facts_of
import pytest

FACTS = json.loads(facts_of.FACTS.read_text(encoding="utf-8"))


@pytest.mark.parametrize("page", facts_of.PAGES, ids=lambda page: page.name)
def test_pages_have_the_figures_of_the_facts(page):
    text = page.read_text(encoding="utf-8")
    assert facts_of.filled(text, FACTS) == text
    assert text.count("<!-- fact ") == len(facts_of._FACT.findall(text)), "a marker without a figure"


def test_figures_keep_their_decimals_and_stale_ones_are_noticed():
    group = {"commit": "0123abc", "facts": {"mb": 9.44, "rows": 1234567.0}}
    text = "at <!-- fact a.commit -->fedcba9: <!-- fact a.mb -->8.1, <!-- fact a.rows -->1,000."
    want = "at <!-- fact a.commit -->0123abc: <!-- fact a.mb -->9.4, <!-- fact a.rows -->1,234,567."
    assert facts_of.filled(text, {"a": group}) == want
    with pytest.raises(KeyError):
        facts_of.filled("<!-- fact a.gone -->1", {"a": group})
    page = "<!-- table t -->\nold\n<!-- end -->\n"
    assert facts_of.filled(page, {"t": {"table": "| new |\n"}}) == "<!-- table t -->\n| new |\n<!-- end -->\n"


def test_facts_of_a_release_are_those_that_the_pages_name(smoke):
    measured = {
        "release": facts_of.sizes(smoke / "release") | facts_of.of_routes(smoke / "release"),
        "plans": facts_of.of_plans(smoke),
    }
    measured["release"] |= facts_of.of_tasks(smoke / "release")
    assert measured["release"]["tasks_rows"] == 2 * measured["release"]["routes_rows"] > 0
    named = {at for page in facts_of.PAGES for at in re.findall(r"<!-- fact (\w+)\.(\w+) -->", page.read_text())}
    missing = {f"{group}.{name}" for group, name in named if name not in {*measured[group], "commit", "machine"}}
    assert not {name for name in missing if "long_horizon" not in name}  # the smoke release has no such tasks
