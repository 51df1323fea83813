"""Where the parts of a batch are planned: on this machine, or on a dask cluster."""

from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from typing import Any

import click

from .ledger import made_here
from .part_task import PartEnd, PartTask, plan_part, stop_parts

Runner = Callable[[Iterable[PartTask]], Generator[PartEnd]]

# Times that a part is begun whose worker was lost with it; seconds for a scheduler.
_RETRIES, _ANSWERS_S = 3, 10
_EXTRA = "pip install 'ringrig[cluster]'"


@contextmanager
def local(jobs: int) -> Generator[Runner]:
    """Give what plans so many parts at a time here, in the order in which they end."""
    from joblib import Parallel, delayed

    def run(tasks: Iterable[PartTask]) -> Generator[PartEnd]:
        # Each part is a process already: a thread waits for it.
        parallel: Any = Parallel(
            n_jobs=jobs,
            backend="threading",
            return_as="generator_unordered",
            pre_dispatch=str(jobs),
        )
        yield from parallel(delayed(plan_part)(task) for task in tasks)

    try:
        yield run
    except BaseException:
        stop_parts()
        raise


@contextmanager
def cluster(address: str) -> Generator[tuple[Runner, int]]:
    """Give what plans parts on the workers of a dask scheduler, and their number.

    A worker that dies takes its part to another one.

    Raises:
        click.UsageError: If there is no scheduler, no worker, or another ringrig there.
    """
    try:
        from distributed import (  # pyright: ignore[reportMissingImports]
            Client,
            as_completed,
        )
        from distributed.comm.addressing import (  # pyright: ignore[reportMissingImports]
            resolve_address,
        )
    except ImportError:
        raise click.UsageError(
            f"--scheduler needs dask.distributed, which isn't there: {_EXTRA}"
        ) from None
    try:
        # Of what is no address a client is half made, and waits for its own end.
        resolve_address(address)
        client: Any = Client(address, timeout=_ANSWERS_S, set_as_default=False)
    except ValueError as error:
        raise click.UsageError(
            f"--scheduler {address}: isn't an address ({_line(error)}); give it as "
            f"tcp://host:8786"
        ) from None
    except (OSError, TimeoutError) as error:
        raise click.UsageError(
            f"--scheduler {address}: no scheduler answers there ({_line(error)}); "
            f"start one with `dask scheduler`, and workers with `dask worker {address}`"
        ) from None
    with client:
        versions: dict[str, str] = client.run(_version)
        if not versions:
            raise click.UsageError(
                f"--scheduler {address}: it has no worker; start some with "
                f"`dask worker {address} --nthreads 1`"
            )
        other = {place: found for place, found in versions.items() if found != _here()}
        if other:
            place, found = next(iter(other.items()))
            raise click.UsageError(
                f"--scheduler {address}: worker {place} has ringrig {found}, here it "
                f"is {_here()}: plans would differ; install the same"
            )

        def run(tasks: Iterable[PartTask]) -> Generator[PartEnd]:
            every: Sequence[PartTask] = tuple(tasks)
            futures = {
                client.submit(plan_part, task, pure=False, retries=_RETRIES): task
                for task in every
            }
            try:
                for future in as_completed(list(futures), loop=client.loop):
                    task = futures[future]
                    error = future.exception()
                    if error is None:
                        yield future.result()
                    else:
                        words = f"its workers were lost: {_line(error)}"
                        yield PartEnd(task.name, -9, words, 0.0, {})
                    future.release()
            finally:
                client.cancel(list(futures))

        yield run, len(versions)


def _version() -> str:
    # Of the worker's own installation; its code says the rest.
    return f"{version('ringrig')}-{made_here()[:12]}"


def _here() -> str:
    return _version()


def _line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
