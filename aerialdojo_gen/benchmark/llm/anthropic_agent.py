"""Anthropic's messages protocol."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from aerialdojo_gen.base.pictures import Picture
from aerialdojo_gen.benchmark.llm.agent import LanguageModelAgent, Message, Reply, Schema, token_count
from aerialdojo_gen.benchmark.llm.options import Form


class AnthropicAgent(LanguageModelAgent):
    """Asks a model by way of the package ``anthropic``; the key is ANTHROPIC_API_KEY's, or ``key_env``'s."""

    package = "anthropic"
    forms: tuple[Form, ...] = ("tool", "json", "text")

    def ask(
        self, system: str, messages: Sequence[Message], retries: int | None = None, schema: Schema | None = None
    ) -> Reply:
        """Send one request; see `LanguageModelAgent.ask`."""
        o, service = self.options, self.service
        # By the body, for the package has dropped the argument: its newest models take no temperature.
        body = (
            self._form(schema)
            | dict(o.extra_body)
            | ({} if o.temperature is None else {"temperature": o.temperature})
        )
        said = [_as_message(message) for message in messages]
        message = service.call(
            lambda client: client.messages.create(
                model=o.model, max_tokens=o.max_tokens, system=system, messages=said, extra_body=body
            ),
            retries,
        )
        content = getattr(message, "content", None)
        if not isinstance(content, list):
            raise service.not_understood("message")
        usage = getattr(message, "usage", None)
        return Reply(
            service.clean(_tool_call(content) or _text(content)),
            token_count(getattr(usage, "input_tokens", None)),
            token_count(getattr(usage, "output_tokens", None)),
        )

    def _form(self, schema: Schema | None) -> dict[str, Any]:
        name, what = ("act", "Do one action.") if schema is None else ("answer", "Give the answer.")
        schema = schema or self.options.action_set.schema()
        if self.form == "json":
            return {"output_config": {"format": {"type": "json_schema", "schema": schema}}}
        if self.form == "tool":
            tool = {"name": name, "description": what, "input_schema": schema}
            return {"tools": [tool], "tool_choice": {"type": "tool", "name": name}}
        return {}


def _tool_call(content: list[Any]) -> str | None:
    for block in content:
        if getattr(block, "type", None) == "tool_use":
            return json.dumps(getattr(block, "input", None))
    return None


def _text(content: list[Any]) -> str:
    texts = (getattr(block, "text", None) for block in content if getattr(block, "type", None) == "text")
    return "".join(text for text in texts if isinstance(text, str))


def _as_message(message: Message) -> dict[str, Any]:
    parts = [
        {"type": "image", "source": {"type": "base64", "media_type": p.media_type, "data": p.base64}}
        if isinstance(p, Picture)
        else {"type": "text", "text": p}
        for p in message.parts
    ]
    return {"role": message.role, "content": parts}
