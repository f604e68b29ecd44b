"""The protocols of language models' services: OpenAI's chat, as many servers speak it, and Anthropic's messages."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from aerialdojo_gen.base.pictures import Picture
from aerialdojo_gen.benchmark.llm.agent import LanguageModelAgent, Message, Reply, Schema
from aerialdojo_gen.benchmark.llm.options import Form


class OpenAIAgent(LanguageModelAgent):
    """Asks by the package ``openai``: OpenAI's own service, vLLM, Ollama, llama.cpp, and whatever else speaks it.

    The key is OPENAI_API_KEY's, or ``key_env``'s; an own service may need none.
    """

    package = "openai"

    async def request(self, client: Any, system: str, messages: Sequence[Message], body: dict[str, Any]) -> Any:
        """Send a request by the package."""
        o = self.options
        limit = "max_completion_tokens" if self.service.base_url is None else "max_tokens"
        said = [{"role": o.system_role, "content": system}, *map(self._message, messages)]
        body = {limit: o.max_tokens} | body
        return await client.chat.completions.create(model=o.model, messages=said, extra_body=body)

    def read(self, answer: Any) -> Reply:
        """Read the service's answer."""
        choices = getattr(answer, "choices", None)
        choice = choices[0] if isinstance(choices, list) and choices else None
        message = getattr(choice, "message", None)
        content = getattr(message, "content", None)
        if message is None or not (content is None or isinstance(content, str)):
            raise self.service.not_understood("chat completion")
        if not content and getattr(choice, "finish_reason", None) == "content_filter":
            raise self.service.unusable("its content filter took the answer away", "content filter")
        calls = getattr(message, "tool_calls", None)
        function = getattr(calls[0], "function", None) if isinstance(calls, list) and calls else None
        arguments = getattr(function, "arguments", None)
        text = (arguments if isinstance(arguments, str) else "") or content or ""
        return self.reply(text, answer, "prompt_tokens", "completion_tokens")

    def form_of(self, name: str, what: str, schema: Schema) -> dict[str, Any]:
        """Ask for an answer of a schema."""
        if self.form == "json":
            form = {"name": "action" if name == "act" else name, "strict": True, "schema": schema}
            return {"response_format": {"type": "json_schema", "json_schema": form}}
        if self.form == "tool":
            tool = {"name": name, "description": what, "strict": True, "parameters": schema}
            return {
                "tools": [{"type": "function", "function": tool}],
                "tool_choice": {"type": "function", "function": {"name": name}},
            }
        return {}

    def _message(self, message: Message) -> dict[str, Any]:
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


class AnthropicAgent(LanguageModelAgent):
    """Asks a model by way of the package ``anthropic``; the key is ANTHROPIC_API_KEY's, or ``key_env``'s."""

    package = "anthropic"
    forms: tuple[Form, ...] = ("tool", "json", "text")

    async def request(self, client: Any, system: str, messages: Sequence[Message], body: dict[str, Any]) -> Any:
        """Send a request by the package."""
        o, said = self.options, [*map(self._message, messages)]
        return await client.messages.create(
            model=o.model, max_tokens=o.max_tokens, system=system, messages=said, extra_body=body
        )

    def read(self, answer: Any) -> Reply:
        """Read the service's answer."""
        content = getattr(answer, "content", None)
        if not isinstance(content, list):
            raise self.service.not_understood("message")
        calls = (getattr(block, "input", None) for block in content if getattr(block, "type", None) == "tool_use")
        texts = (getattr(block, "text", None) for block in content if getattr(block, "type", None) == "text")
        said = "".join(text for text in texts if isinstance(text, str))
        return self.reply(next(map(json.dumps, calls), said), answer, "input_tokens", "output_tokens")

    def form_of(self, name: str, what: str, schema: Schema) -> dict[str, Any]:
        """Ask for an answer of a schema."""
        if self.form == "json":
            return {"output_config": {"format": {"type": "json_schema", "schema": schema}}}
        if self.form == "tool":
            tool = {"name": name, "description": what, "input_schema": schema}
            return {"tools": [tool], "tool_choice": {"type": "tool", "name": name}}
        return {}

    def _message(self, message: Message) -> dict[str, Any]:
        parts = [
            {"type": "image", "source": {"type": "base64", "media_type": p.media_type, "data": p.base64}}
            if isinstance(p, Picture)
            else {"type": "text", "text": p}
            for p in message.parts
        ]
        return {"role": message.role, "content": parts}
