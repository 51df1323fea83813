"""How long the pairs of a rig will take, told before the first and after each."""

import math
import time
from collections.abc import Callable

from planning.model.words import count_words

# One pair's frames, drawn and decoded, take as long as that many views of a camera are
# cast: 0.8 to 2.2 on the sample and the horse.
_VIEWS_A_PAIR = 1.4


def countdown(
    say: Callable[[str], None],
    *,
    n_cameras: int,
    threads: int,
    all_first: bool = False,
) -> Callable[[int, int], None]:
    """Return what is to be called with the pairs done and their total.

    That is 0 when each thread has cast a view, or all views have been cast first: how
    long this took tells what the pairs will take, on whatever machine.
    """
    n_views = n_cameras if all_first else min(threads, n_cameras)
    begin = time.monotonic()

    def pair_done(done: int, total: int) -> None:
        nonlocal begin
        spent = time.monotonic() - begin
        if done == 0:
            left = math.ceil(_VIEWS_A_PAIR * spent * total / n_views)
            begin = time.monotonic()
            say(f"{total} pairs on {count_words(threads, 'thread')}, about {left} s")
            return
        # When the first is done, so are others beside it.
        left = math.ceil(spent * (total - done) / min(done + threads - 1, total))
        more = f", about {left} s more" if done < total else ""
        say(f"pair {done} of {total}{more}")

    return pair_done
