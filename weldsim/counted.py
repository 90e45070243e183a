"""A number and what it counts, in words."""

IRREGULAR = {"entry": "entries"}


def counted(count: int, word: str) -> str:
    """ "1 seed", "3 seeds".

    Args:
        word: in the singular; of several words the last is the one that is counted.
    """
    if count == 1:
        return f"{count} {word}"
    many = IRREGULAR.get(word) or (f"{word}es" if word.endswith(("s", "sh", "ch", "x")) else f"{word}s")
    return f"{count} {many}"
