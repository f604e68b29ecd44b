"""Anthropic's messages protocol."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from aerialdojo_gen.benchmark.llm.agent import LanguageModelAgent, Message, Reply
from aerialdojo_gen.benchmark.llm.images import Picture


class AnthropicAgent(LanguageModelAgent):
    """Asks a model by way of the package ``anthropic``; the key is ANTHROPIC_API_KEY's.

    Parameters
    ----------
    **options
        Fields of `aerialdojo_gen.benchmark.llm.agent.Options`.
    """

    package = "anthropic"

    def ask(self, system: str, messages: Sequence[Message]) -> Reply:
        """Send one request; see `LanguageModelAgent.ask`."""
        o, service = self.options, self.service
        # By the body, for the package has dropped the argument: its newest models take no temperature.
        body = dict(o.extra_body) | ({} if o.temperature is None else {"temperature": o.temperature})
        said = [_as_message(message) for message in messages]
        message = service.call(
            lambda client: client.messages.create(
                model=o.model, max_tokens=o.max_tokens, system=system, messages=said, extra_body=body
            )
        )
        content = getattr(message, "content", None)
        if not isinstance(content, list):
            raise service.not_understood("message")
        text = "".join(block.text for block in content if block.type == "text")
        usage = getattr(message, "usage", None)
        return Reply(
            service.without_key(text),
            usage.input_tokens if usage else None,
            usage.output_tokens if usage else None,
        )


def _as_message(message: Message) -> dict[str, Any]:
    parts = [
        {"type": "image", "source": {"type": "base64", "media_type": p.media_type, "data": p.base64}}
        if isinstance(p, Picture)
        else {"type": "text", "text": p}
        for p in message.parts
    ]
    return {"role": message.role, "content": parts}
