"""The site's reference covers the whole program, the site has every page of docs/, and it works without a network."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import typer.main
import yaml
from support.browser import chromium, errors, until

from aerialdojo_gen.base.config.keys import config_keys
from aerialdojo_gen.cli.app import app
from aerialdojo_gen.store.layout import LAYOUT

ROOT = next(folder for folder in Path(__file__).resolve().parents if (folder / "pyproject.toml").is_file())


@pytest.fixture(scope="module")
def pages():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "docs/site")
        import reference
    return reference.pages()


def test_every_command_is_there_with_every_option(pages):
    parts = dict(re.findall(r"^## ([\w -]+)\n(.*?)(?=^## |\Z)", pages["reference/cli.md"], re.MULTILINE | re.DOTALL))
    group = typer.main.get_command(app)
    inner = {f"config {name}": one for name, one in group.commands["config"].commands.items()}
    commands = {**group.commands, **inner}
    del commands["config"]
    assert set(parts) == set(commands)
    for name, command in commands.items():
        for one in command.params:
            for text in (*one.opts, *one.secondary_opts) if one.param_type_name == "option" else ():
                assert re.search(rf"(`|, | / ){text}\b", parts[name]), (name, text)


def test_every_key_and_every_column_is_there_with_its_unit(pages):
    rows = re.findall(r"^\| `([a-z0-9_]+)` \| ([^|]*) \|", pages["reference/config.md"], re.MULTILINE)
    keys = [(key.name, key.unit) for key in config_keys()]
    assert sorted(keys) == sorted((name, unit.strip()) for name, unit in rows)
    heads = re.findall(r"^##+ (.*)", pages["reference/config.md"], re.MULTILINE)
    assert len(heads) == len(set(heads)) == len({key.section for key in config_keys()})
    for name, place in LAYOUT.items():
        part = pages["reference/tables.md"].partition(f"\n## {name.partition('/t')[0]}\n")[2].partition("\n## ")[0]
        found = re.findall(r"^\| `([a-z0-9_]+)` \| ([^|]*) \| ([^|]*) \|", part, re.MULTILINE)
        assert [one for one, _, _ in found] == place.spec.schema.names
        for field, (_, kind, unit) in zip(place.spec.schema, found, strict=True):
            assert (field.metadata or {}).get(b"unit", b"").decode() == unit.strip()
            assert field.nullable == kind.endswith("or null")


def test_tables_of_the_reference_are_as_wide_in_every_row(pages):
    for name, text in pages.items():
        for block in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
            lines = re.sub(r"`[^`]*`", "", block).splitlines()
            assert len({len(re.findall(r"(?<!\\)\|", line)) for line in lines}) == 1, (name, block[:200])


def test_every_page_stands_in_the_navigation_and_what_stands_there_exists(pages):
    nav = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]
    listed = re.findall(r"[\w/.-]+\.md", str(nav))
    hooks = (ROOT / "docs/site/hooks.py").read_text(encoding="utf-8")
    brought = re.findall(r'"([\w/-]+\.md)": "([\w/]+\.md)"', hooks)
    assert len(listed) == len(set(listed))
    own = {str(page.relative_to(ROOT / "docs")) for page in (ROOT / "docs").rglob("*.md")}
    assert set(listed) == own | set(pages) | {page for page, _ in brought}
    assert all((ROOT / source).is_file() for _, source in brought)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site as `make docs` builds it, in a folder of its own."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", folder]
    env = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.nightly
def test_no_page_or_style_of_the_site_loads_anything_from_elsewhere(site):
    loads = re.compile(
        r"""<(?!a\s)[^>]*\s(?:src|srcset|data|poster|href)=["']?((?:https?:)?//[^"'\s>]*)|"""
        r"""(?:url\(|@import\s)\s*["']?((?:https?:)?//[^"')\s]*)"""
    )
    pages = [*site.rglob("*.html"), *site.rglob("*.css")]
    assert len(pages) > 30
    assert {found for page in pages for found in loads.findall(page.read_text(encoding="utf-8"))} == set()


@pytest.mark.browser
@pytest.mark.nightly
def test_search_works_where_the_site_is_opened_from_a_folder(site):
    with chromium("the site's search") as driver:
        for page in ("faq.html", "reference/cli.html"):
            driver.get((site / page).as_uri())
            driver.find_element("css selector", "input[name=query]").click()
            driver.find_element("css selector", "input[name=query]").send_keys("object store")
            found = until("results", lambda: driver.find_elements("css selector", ".md-search-result__item a"))
            assert found[0].get_attribute("href") == (site / "object-store.html").as_uri()
            assert errors(driver) == []
