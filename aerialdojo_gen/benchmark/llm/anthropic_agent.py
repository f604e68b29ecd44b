"""Anthropic's messages protocol."""

from __future__ import annotations

import importlib
import os
from collections.abc import Sequence
from typing import Any

from aerialdojo_gen.benchmark.agents.base import AgentUnavailable
from aerialdojo_gen.benchmark.llm.agent import LanguageModelAgent, Message, Reply
from aerialdojo_gen.benchmark.llm.images import Picture
from aerialdojo_gen.benchmark.llm.service import api_key, bounded_client, call, without_key
from aerialdojo_gen.errors import UsageError


class AnthropicAgent(LanguageModelAgent):
    """Asks a model by way of the package ``anthropic``; the key is ANTHROPIC_API_KEY's.

    Parameters
    ----------
    **options
        Fields of `aerialdojo_gen.benchmark.llm.agent.Options`.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        try:
            self._package = importlib.import_module("anthropic")
        except ImportError:
            raise UsageError(
                "the anthropic agent needs the package anthropic: pip install 'aerialdojo-gen[llm]'"
            ) from None
        base_url = self.options.base_url or os.environ.get("ANTHROPIC_BASE_URL") or None
        self._key = api_key("ANTHROPIC_API_KEY", base_url)
        self._service = base_url or "Anthropic"
        self._client = self._package.Anthropic(
            api_key=self._key,
            base_url=base_url,
            max_retries=0,
            timeout=self.options.timeout_s,
            http_client=bounded_client(self._package.DefaultHttpxClient, self.options.timeout_s),
        )

    def ask(self, system: str, messages: Sequence[Message]) -> Reply:
        """Send one request; see `LanguageModelAgent.ask`."""
        o = self.options
        # By the body, for the package has dropped the argument: its newest models take no temperature.
        body = dict(o.extra_body) | ({} if o.temperature is None else {"temperature": o.temperature})
        said = [_as_message(message) for message in messages]
        message = call(
            lambda: self._client.messages.create(
                model=o.model, max_tokens=o.max_tokens, system=system, messages=said, extra_body=body
            ),
            self._package,
            self._service,
            self._key,
            o.timeout_s,
            o.request_retries,
        )
        content = getattr(message, "content", None)
        if not isinstance(content, list):
            raise AgentUnavailable(f"{self._service}: its answer is no message: is base_url right?")
        text = "".join(block.text for block in content if block.type == "text")
        usage = getattr(message, "usage", None)
        return Reply(
            without_key(text, self._key),
            usage.input_tokens if usage else None,
            usage.output_tokens if usage else None,
        )

    def close(self) -> None:
        """Close the connections."""
        self._client.close()


def _as_message(message: Message) -> dict[str, Any]:
    parts = [
        {"type": "image", "source": {"type": "base64", "media_type": p.media_type, "data": p.base64}}
        if isinstance(p, Picture)
        else {"type": "text", "text": p}
        for p in message.parts
    ]
    return {"role": message.role, "content": parts}
