"""What is left is told from what the views took, then from what the pairs took."""

from planning.verify.reconstruction.render import countdown as module
from planning.verify.reconstruction.render.countdown import countdown


def test_it_goes_by_the_machine_that_it_runs_on(monkeypatch):
    now, said = [100.0], []
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    pair_done = countdown(said.append, n_cameras=2, threads=2)
    # Two views in 2 s: six pairs as long as 8.4 views of 1 s each, two at a time.
    now[0] += 2.0
    pair_done(0, 6)
    # Two pairs each 3 s, told one after the other.
    for done in range(1, 7):
        now[0] += 3.0 if done % 2 else 0.0
        pair_done(done, 6)
    assert said[0] == "6 pairs on 2 threads, about 9 s"
    assert said[1:] == [
        "pair 1 of 6, about 8 s more",
        "pair 2 of 6, about 4 s more",
        "pair 3 of 6, about 5 s more",
        "pair 4 of 6, about 3 s more",
        "pair 5 of 6, about 2 s more",
        "pair 6 of 6",
    ]
