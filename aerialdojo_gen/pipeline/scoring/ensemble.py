"""The configured scorers, and the weighted mean of their scores."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from aerialdojo_gen.base.config.sections import AnchorSampleConfig
from aerialdojo_gen.base.errors import ConfigError
from aerialdojo_gen.pipeline.scoring.base import AnchorView, Scorer
from aerialdojo_gen.pipeline.scoring.geometric import GeometricScorer

SCORERS = ("geometric", "clip", "vlm")


@dataclass(frozen=True)
class Verdict:
    """The ensemble's result for a view."""

    score: float  # Weighted mean of the scorers that gave a score; in [0, 1]
    parts: dict[str, float | None]


class ScorerEnsemble:
    """All scorers of a configuration."""

    def __init__(self, config: AnchorSampleConfig, radius_m: float) -> None:
        self._weighted: list[tuple[float, Scorer]] = []
        weights = config.weights
        if weights.geometric:
            self._weighted.append((weights.geometric, GeometricScorer(radius_m, config.standoff_m)))
        if weights.clip:
            if config.clip is None:
                raise ConfigError(
                    "the clip scorer needs its files: vision, text and tokenizer in [anchor-sample.clip]"
                )
            from aerialdojo_gen.pipeline.scoring.clip import ClipScorer

            self._weighted.append((weights.clip, ClipScorer(config.clip)))
        if weights.vlm:
            if config.vlm is None:
                raise ConfigError("the vlm scorer needs a model's name: model = ... in [anchor-sample.vlm]")
            from aerialdojo_gen.pipeline.scoring.vlm import VlmScorer

            self._weighted.append((weights.vlm, VlmScorer(config.vlm)))

    def judge(self, name: str, views: Sequence[AnchorView]) -> list[Verdict]:
        """Run all scorers."""
        if not views:
            return []
        opinions = {scorer.name: (weight, scorer.score(name, views)) for weight, scorer in self._weighted}
        verdicts = []
        for k in range(len(views)):
            opinions_of_view = [(weight, scores[k]) for weight, scores in opinions.values()]
            known = [(weight, score) for weight, score in opinions_of_view if score is not None]
            total = sum(weight for weight, _ in known)
            parts = {f"score_{name}": opinions[name][1][k] if name in opinions else None for name in SCORERS}
            verdicts.append(Verdict(sum(w * s for w, s in known) / total if total else 0.0, parts))
        return verdicts


@lru_cache(maxsize=2)
def scorer_ensemble(config: AnchorSampleConfig, radius_m: float) -> ScorerEnsemble:
    """Return the ensemble of a configuration, cached: a model takes seconds to load."""
    return ScorerEnsemble(config, radius_m)
