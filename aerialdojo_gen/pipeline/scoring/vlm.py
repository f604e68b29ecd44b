"""A multimodal model behind an OpenAI-compatible endpoint puts the candidates in order."""

from __future__ import annotations

import logging
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from aerialdojo_gen.base.errors import Malformed
from aerialdojo_gen.base.llm_client import Connection
from aerialdojo_gen.base.pictures import colour_picture
from aerialdojo_gen.base.safe_parse import loads_json
from aerialdojo_gen.pipeline.scoring.base import AnchorView

if TYPE_CHECKING:
    from aerialdojo_gen.base.config.sections import VlmConfig

log = logging.getLogger(__name__)

_SYSTEM = (
    "You choose the picture that best shows one object to somebody who must recognise it from that picture alone: "
    "the object is whole, not hidden, large enough, seen from a side that tells what it is, and clearly apart from "
    "what is around it. You answer with one JSON object and nothing else."
)
_ASK = (
    'The object: "{name}". There are {n} pictures, numbered 1 to {n} in the order in which they were shown. Put all '
    'of them in order, the best first: {{"order": [...]}} with each of the numbers 1 to {n} once.'
)
_RETRY = "That is not what was asked for ({why}). Answer with the JSON object alone."
# Wrappers around an answer.
_WRAPPED = re.compile(r"\A\s*(?:<think>.*?</think>)?\s*(?:```(?:json)?[ \t]*\n)?(.*?)(?:\n?```)?\s*\Z", re.DOTALL)


class VlmScorer:
    """A `Scorer` by the order that a model gives: best 1, worst 0; asked twice at most, then it has no opinion."""

    name = "vlm"

    def __init__(self, config: VlmConfig) -> None:
        self._config = config
        self._service = Connection("openai", config.base_url, config.timeout_s, config.retries, model=config.model)

    def score(self, name: str, views: Sequence[AnchorView]) -> list[float | None]:
        """Score views by the model's order."""
        n = len(views)
        if n == 1:
            return [1.0]
        content: list[dict[str, Any]] = []
        for k, view in enumerate(views, start=1):
            picture = colour_picture(view.rgb, self._config.picture_px)
            content.append({"type": "text", "text": f"Picture {k}:"})
            content.append({"type": "image_url", "image_url": {"url": picture.data_url}})
        content.append({"type": "text", "text": _ASK.format(name=name, n=n)})
        messages: list[dict[str, Any]] = [
            {"role": "system", "content": _SYSTEM},
            {"role": "user", "content": content},
        ]
        why = ""
        for _ in range(2):
            text = self._complete(messages)
            try:
                order = read_order(text, n)
            except ValueError as error:
                why = str(error)
                messages += [
                    {"role": "assistant", "content": text},
                    {"role": "user", "content": _RETRY.format(why=why)},
                ]
                continue
            scores: list[float | None] = [None] * n
            for rank, k in enumerate(order):
                scores[k] = 1.0 - rank / (n - 1)
            return scores
        log.warning("the model gave no order for %s: %s", name, why)
        return [None] * n

    def _complete(self, messages: list[dict[str, Any]]) -> str:
        # OpenAI's newer models take no max_tokens, many other servers nothing else.
        limit = "max_completion_tokens" if self._service.base_url is None else "max_tokens"
        body: dict[str, Any] = {limit: self._config.max_tokens}
        if self._config.temperature is not None:
            body["temperature"] = self._config.temperature
        completion = self._service.call(
            lambda client: client.chat.completions.create(
                model=self._config.model, messages=messages, extra_body=body
            )
        )
        choices = getattr(completion, "choices", None)
        message = getattr(choices[0], "message", None) if isinstance(choices, list) and choices else None
        content = getattr(message, "content", None)
        if message is None or not (content is None or isinstance(content, str)):
            raise self._service.not_understood("chat completion")
        return self._service.clean(content or "")


def read_order(text: str, n: int) -> list[int]:
    """Read a model's order, strictly."""
    wrapped = _WRAPPED.match(text)
    try:
        value = loads_json(wrapped[1] if wrapped else text)
    except Malformed:
        raise ValueError("it is not one JSON object") from None
    if not isinstance(value, dict) or set(value) != {"order"} or not isinstance(value["order"], list):
        raise ValueError('it is no object with the one key "order" and a list in it')
    order = value["order"]
    if any(type(k) is not int for k in order) or sorted(order) != list(range(1, n + 1)):
        raise ValueError(f"the list does not hold each of the numbers 1 to {n} once")
    return [k - 1 for k in order]
