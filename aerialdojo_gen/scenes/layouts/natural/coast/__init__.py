"""A coast: a seaside resort with its promenade and pier, or a cliff coast with a fishing cove."""
