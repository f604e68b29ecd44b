"""The OpenAI-compatible chat protocol: OpenAI's own service, vLLM, llama.cpp, and whatever else speaks it."""

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


class OpenAIAgent(LanguageModelAgent):
    """Asks a model by way of the package ``openai``; the key is OPENAI_API_KEY's.

    A service of one's own (``base_url``, or OPENAI_BASE_URL) may do without a key. Its answers are bounded by
    ``max_tokens``, OpenAI's own by ``max_completion_tokens``, the only one that its newer models take.

    Parameters
    ----------
    **options
        Fields of `aerialdojo_gen.benchmark.llm.agent.Options`.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        try:
            self._package = importlib.import_module("openai")
        except ImportError:
            raise UsageError("the openai agent needs the package openai: pip install 'aerialdojo-gen[llm]'") from None
        base_url = self.options.base_url or os.environ.get("OPENAI_BASE_URL") or None
        self._key = api_key("OPENAI_API_KEY", base_url)
        self._service = base_url or "OpenAI"
        self._limit = "max_completion_tokens" if base_url is None else "max_tokens"
        self._client = self._package.OpenAI(
            api_key=self._key,
            base_url=base_url,
            max_retries=0,
            timeout=self.options.timeout_s,
            http_client=bounded_client(self._package.DefaultHttpxClient, self.options.timeout_s),
        )

    def ask(self, system: str, messages: Sequence[Message]) -> Reply:
        """Send one request; see `LanguageModelAgent.ask`."""
        o = self.options
        body: dict[str, Any] = {self._limit: o.max_tokens} | o.extra_body
        if o.temperature is not None:
            body["temperature"] = o.temperature
        said = [{"role": "system", "content": system}, *map(_as_message, messages)]
        completion = call(
            lambda: self._client.chat.completions.create(model=o.model, messages=said, extra_body=body),
            self._package,
            self._service,
            self._key,
            o.timeout_s,
            o.request_retries,
        )
        choices = getattr(completion, "choices", None)
        if not choices or getattr(choices[0], "message", None) is None:
            raise AgentUnavailable(f"{self._service}: its answer is no chat completion: is base_url right?")
        usage = completion.usage
        return Reply(
            without_key(choices[0].message.content or "", self._key),
            usage.prompt_tokens if usage else None,
            usage.completion_tokens if usage else None,
        )

    def close(self) -> None:
        """Close the connections."""
        self._client.close()


def _as_message(message: Message) -> dict[str, Any]:
    if message.role == "assistant":
        # Many servers take nothing but a string from the assistant.
        return {"role": "assistant", "content": "".join(p for p in message.parts if isinstance(p, str))}
    parts = [
        {"type": "image_url", "image_url": {"url": p.data_url}}
        if isinstance(p, Picture)
        else {"type": "text", "text": p}
        for p in message.parts
    ]
    return {"role": message.role, "content": parts}
