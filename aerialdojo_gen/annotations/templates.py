"""Sentences that drafts are made of.

Fields: {a} the thing with the indefinite article, {the} with the definite one, {bare} without; {look} a noun phrase
of what it looks like; {verb} stands, {ing} standing; {rel} where, e.g. "beside a red mailbox".
"""

from __future__ import annotations

# With a look; those with "with {look}" are not for nouns that end in "with ..." already.
FULL = (
    "{A} with {look}, {ing} {rel}.",
    "{A} {ing} {rel}. It has {look}.",
    "This {bare} {verb} {rel} and has {look}.",
    "Look for {a} {ing} {rel}; it has {look}.",
    "{A} with {look} that {verb} {rel}.",
    "{Rel} {verb} {a} with {look}.",
    "{Rel} {verb} {a}. You can tell it by {look}.",
    "The {bare} {verb} {rel}. You will know it by {look}.",
    "You are looking for {a}. It has {look} and {verb} {rel}.",
    "Find the {bare} {rel}: it has {look}.",
    "It is {a} with {look}, and it {verb} {rel}.",
    "{A}, recognisable by {look}. It {verb} {rel}.",
    "Search for {a} {rel}. It has {look}.",
    "The one you want {verb} {rel}: {a} with {look}.",
    "{Rel} you will see {a} with {look}.",
    "{Rel} you will find {a}; it has {look}.",
    "With {look}, this {bare} {verb} {rel}.",
    "{A}. It has {look} and {verb} {rel}.",
    "The {bare} {rel} is the target. It has {look}.",
    "Your target is {a}, {ing} {rel}. It has {look}.",
    "{A} {verb} {rel}. You will notice {look}.",
    "Go to the {bare} {rel}, the one with {look}.",
    "{Rel}, {a} {verb}; note {look}.",
)
# For categories without a look.
PLAIN = (
    "{A} {ing} {rel}.",
    "This {bare} {verb} {rel}.",
    "{Rel} {verb} {a}.",
    "Look for {a} {ing} {rel}.",
    "You will find {a} {rel}.",
    "The {bare} {verb} {rel}.",
    "It is {a}, {ing} {rel}.",
)
# For what does not fit into the first {rel}.
MORE = (
    "It is also {rel}.",
    "More exactly, it {verb} {rel}.",
    "You will see it {rel}.",
    "Seen from the air, it is {rel}.",
)
RELATIONS = {
    "beside": ("beside {}", "next to {}", "right beside {}", "right next to {}"),
    "near": ("near {}", "close to {}", "not far from {}", "a few steps from {}"),
    "on": ("on {}", "on top of {}"),
    "under": ("under {}", "beneath {}", "underneath {}"),
    "side": ("just {d} of {}", "to the {d} of {}", "on the {d} side of {}"),
    "between": ("between {}",),
}
