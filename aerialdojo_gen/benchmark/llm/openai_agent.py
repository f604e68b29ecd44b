"""The OpenAI-compatible chat protocol: OpenAI's own service, vLLM, llama.cpp, and whatever else speaks it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from aerialdojo_gen.benchmark.llm.agent import LanguageModelAgent, Message, Reply
from aerialdojo_gen.benchmark.llm.images import Picture


class OpenAIAgent(LanguageModelAgent):
    """Asks a model by way of the package ``openai``; the key is OPENAI_API_KEY's.

    A service of one's own (``base_url``, or OPENAI_BASE_URL) may do without a key. Its answers are bounded by
    ``max_tokens``, OpenAI's own by ``max_completion_tokens``, the only one that its newer models take.

    Parameters
    ----------
    **options
        Fields of `aerialdojo_gen.benchmark.llm.agent.Options`.
    """

    package = "openai"

    def ask(self, system: str, messages: Sequence[Message]) -> Reply:
        """Send one request; see `LanguageModelAgent.ask`."""
        o, service = self.options, self.service
        limit = "max_completion_tokens" if service.base_url is None else "max_tokens"
        body: dict[str, Any] = {limit: o.max_tokens} | o.extra_body
        if o.temperature is not None:
            body["temperature"] = o.temperature
        said = [{"role": "system", "content": system}, *map(_as_message, messages)]
        completion = service.call(
            lambda client: client.chat.completions.create(model=o.model, messages=said, extra_body=body)
        )
        choices = getattr(completion, "choices", None)
        if not choices or getattr(choices[0], "message", None) is None:
            raise service.not_understood("chat completion")
        usage = completion.usage
        return Reply(
            service.without_key(choices[0].message.content or ""),
            usage.prompt_tokens if usage else None,
            usage.completion_tokens if usage else None,
        )


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
