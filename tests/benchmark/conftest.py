"""What several tests of the benchmark fly in."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.flying import town
from support.llm_server import KEY, PROTOCOLS
from support.walled import write_walled

from aerialdojo_gen.planning.flight_space import FlightSpace


@pytest.fixture(scope="session")
def court(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A release of three tasks beside a wall and a roof: read it."""
    return write_walled(tmp_path_factory.mktemp("walled"))


@pytest.fixture(scope="session")
def village() -> FlightSpace:
    return FlightSpace(town(), 0.25)


@pytest.fixture
def keys(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keys for the services of language models, which are where they are by themselves."""
    for name in ("OPENAI", "ANTHROPIC"):
        monkeypatch.setenv(f"{name}_API_KEY", KEY)
        monkeypatch.delenv(f"{name}_BASE_URL", raising=False)


@pytest.fixture(params=PROTOCOLS)
def protocol(request: pytest.FixtureRequest) -> str:
    return request.param
