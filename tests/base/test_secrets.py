"""Secrets in the environment are found by the names of their variables."""

import pytest

from aerialdojo_gen.base.secrets import REDACTED, Secrets


@pytest.mark.parametrize("name", ["PWD", "OLDPWD"])
def test_the_working_directory_is_no_password(name, monkeypatch):
    monkeypatch.setenv(name, "/home/someone/project")
    monkeypatch.setenv("DATABASE_PWD", "long-secret-word")
    said = Secrets().text("/home/someone/project/agent.py: long-secret-word")
    assert said == f"/home/someone/project/agent.py: {REDACTED}"
