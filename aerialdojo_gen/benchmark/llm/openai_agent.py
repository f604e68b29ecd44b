"""The OpenAI-compatible chat protocol: OpenAI's own service, vLLM, Ollama, llama.cpp, and whatever else speaks it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from aerialdojo_gen.base.pictures import Picture
from aerialdojo_gen.benchmark.llm.agent import LanguageModelAgent, Message, Reply, Schema, token_count


class OpenAIAgent(LanguageModelAgent):
    """Asks by the package ``openai``; the key is OPENAI_API_KEY's, or ``key_env``'s; an own service may need none."""

    package = "openai"

    def ask(
        self, system: str, messages: Sequence[Message], retries: int | None = None, schema: Schema | None = None
    ) -> Reply:
        """Send one request; see `LanguageModelAgent.ask`."""
        o, service = self.options, self.service
        limit = "max_completion_tokens" if service.base_url is None else "max_tokens"
        body: dict[str, Any] = {limit: o.max_tokens} | self._form(schema) | o.extra_body
        if o.temperature is not None:
            body["temperature"] = o.temperature
        said = [{"role": o.system_role, "content": system}, *map(_as_message, messages)]
        completion = service.call(
            lambda client: client.chat.completions.create(model=o.model, messages=said, extra_body=body), retries
        )
        choices = getattr(completion, "choices", None)
        choice = choices[0] if isinstance(choices, list) and choices else None
        message = getattr(choice, "message", None)
        content = getattr(message, "content", None)
        if message is None or not (content is None or isinstance(content, str)):
            raise service.not_understood("chat completion")
        if not content and getattr(choice, "finish_reason", None) == "content_filter":
            raise service.filtered()
        usage = getattr(completion, "usage", None)
        return Reply(
            service.clean(_tool_call(message) or content or ""),
            token_count(getattr(usage, "prompt_tokens", None)),
            token_count(getattr(usage, "completion_tokens", None)),
        )

    def _form(self, schema: Schema | None) -> dict[str, Any]:
        name, what = ("act", "Do one action.") if schema is None else ("answer", "Give the answer.")
        form = {"name": "action" if schema is None else name, "strict": True}
        schema = schema or self.options.action_set.schema()
        if self.form == "json":
            return {"response_format": {"type": "json_schema", "json_schema": form | {"schema": schema}}}
        if self.form == "tool":
            tool = {"name": name, "description": what, "strict": True, "parameters": schema}
            return {
                "tools": [{"type": "function", "function": tool}],
                "tool_choice": {"type": "function", "function": {"name": name}},
            }
        return {}


def _tool_call(message: Any) -> str | None:
    calls = getattr(message, "tool_calls", None)
    function = getattr(calls[0], "function", None) if isinstance(calls, list) and calls else None
    arguments = getattr(function, "arguments", None)
    return arguments if isinstance(arguments, str) else None


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
