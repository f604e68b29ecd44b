"""Texts from claims: a small grammar of sentences, noun phrases and wordings of relations."""
