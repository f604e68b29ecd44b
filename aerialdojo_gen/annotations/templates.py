"""Sentences that drafts are made of.

Fields: {a} the thing with the indefinite article, {the} with the definite one, {bare} without; {look} a noun phrase
of what it looks like; {verb} stands, {ing} standing, {stands} the verb after a place;
{rel} where, e.g. "beside a red mailbox".
"""

from __future__ import annotations

# With a look; those with "with {look}" are not for nouns that end in "with ..." already.
# The first sentence always says what and where: somebody may read no farther.
FULL = (
    "{A} with {look}, {ing} {rel}.",
    "{A} {ing} {rel}. It has {look}.",
    "This {bare} {verb} {rel}. It has {look}.",
    "Look for {a} {ing} {rel}; it has {look}.",
    "{A} that {verb} {rel} and has {look}.",
    "{Rel} {stands} {a} with {look}.",
    "{Rel} {stands} {a}. You can tell it by {look}.",
    "The {bare} {verb} {rel}. You will know it by {look}.",
    "Find the {bare} {rel}: it has {look}.",
    "It is {a} with {look}, and it {verb} {rel}.",
    "Search for {a} {rel}. It has {look}.",
    "{Rel} you will see {a} with {look}.",
    "{Rel} you will find {a}; it has {look}.",
    "The target is {a} {ing} {rel}. It has {look}.",
    "Your target is {a}, {ing} {rel}. It has {look}.",
    "{A} {verb} {rel}. You will notice {look}.",
    "Go to the {bare} {rel}, the one with {look}.",
)
# For what no look is true of.
PLAIN = (
    "{A} {ing} {rel}.",
    "This {bare} {verb} {rel}.",
    "{Rel} {stands} {a}.",
    "Look for {a} {ing} {rel}.",
    "You will find {a} {rel}.",
    "The {bare} {verb} {rel}.",
    "It is {a}, {ing} {rel}.",
)
# For what is worth saying besides.
MORE = ("It is also {rel}.",)
RELATIONS = {
    "beside": ("beside {}", "next to {}", "right beside {}", "right next to {}"),
    "near": ("near {}", "close to {}", "not far from {}", "a few steps from {}"),
    "on": ("on {}", "on top of {}"),
    "under": ("under {}", "beneath {}", "underneath {}"),
    "side": ("just {d} of {}", "to the {d} of {}", "on the {d} side of {}"),
    "between": ("between {}",),
}
