"""Who winds the runs of a sweep: processes, or workers of dask; shards, and what is missing."""

from __future__ import annotations

import contextlib
import ipaddress
import itertools
import logging
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import joblib

from cable_fem_node.winding.prediction import PlannedRun
from winding_study.run_store import Arrays, RunStore, solver_version
from winding_study.sweep.outcome import wind_batch

LARGEST_BATCH = 20

PATIENCE = 3  # How often in a row workers may be killed before anything new is done
IDLE_TIME = 20.0  # After this an idle process ends [s]: soon enough when its parent was killed
CONNECT_TIME = 20.0  # Time for a scheduler to answer and to have its first worker [s]
# Where the status page of a scheduler of this machine listens: any free port, on this machine only.
LOOPBACK = "127.0.0.1:0"


class EngineError(RuntimeError):
    """An engine cannot go on; what is stored stays stored."""


class Engine(Protocol):
    """Winds runs in other processes."""

    def wind(self, runs: Mapping[str, PlannedRun], store: RunStore) -> Iterator[tuple[str, Arrays]]:
        """Wind runs and yield (key, results) in any order; each is in the store when it comes.

        Raises:
            EngineError: The engine cannot go on.
            SolverMismatchError: A worker has another solver.
            OSError: The store cannot be written.
        """


def batches(
    runs: Mapping[str, PlannedRun], workers: int, largest: int = LARGEST_BATCH
) -> list[list[tuple[str, PlannedRun]]]:
    """Return runs in batches: large where runs are many, so that handing over costs little.

    Each worker gets at least four batches, so that none waits long for the last. Solid runs take
    minutes and go one by one.
    """
    size = min(largest, max(1, len(runs) // (4 * workers)))
    if any(run.element == "solid" for run in runs.values()):
        size = 1
    pairs = iter(runs.items())
    return [list(itertools.islice(pairs, size)) for _ in range(0, len(runs), size)]


@dataclass(frozen=True, kw_only=True)
class JoblibEngine:
    """Processes on this machine (joblib with loky); work of a killed process is done again."""

    processes: int = 2  # How many; one winds in this process

    def __post_init__(self) -> None:
        if self.processes < 1:
            raise ValueError(f"processes must be at least 1, got {self.processes}")

    def wind(self, runs: Mapping[str, PlannedRun], store: RunStore) -> Iterator[tuple[str, Arrays]]:
        """Wind runs; see `Engine.wind`.

        Raises:
            EngineError: Worker processes were killed again and again.
        """
        left = dict(runs)
        parent = os.getpid() if self.processes > 1 else None
        largest, idle = LARGEST_BATCH, 0
        while left:
            running = joblib.Parallel(
                n_jobs=self.processes,
                batch_size=1,
                return_as="generator_unordered",
                idle_worker_timeout=IDLE_TIME,
            )(
                joblib.delayed(wind_batch)(batch, store, solver_version(), parent)
                for batch in batches(left, self.processes, largest)
            )
            try:
                for results in running:
                    idle = 0
                    for key, found in results:
                        del left[key]
                        yield key, found
            except BrokenProcessPool as error:
                # One by one, so that a run that kills its process takes no other with it.
                largest, idle = 1, idle + 1
                if idle == PATIENCE:
                    raise EngineError(
                        f"worker processes were killed {idle} times in a row, perhaps for want of "
                        f"memory; {len(left)} runs are missing"
                    ) from error


@dataclass(frozen=True, kw_only=True)
class Certificates:
    """Files of a TLS connection, all in PEM."""

    authority: Path  # Certificate that signed both sides' certificates
    certificate: Path  # This side's certificate
    key: Path  # Its private key

    def __post_init__(self) -> None:
        for path in (self.authority, self.certificate, self.key):
            if not path.is_file():
                raise ValueError(f"there is no certificate file {path}")


def refuse_open_scheduler(address: str, certificates: Certificates | None) -> None:
    """Refuse a scheduler that others on the network could speak to, or speak for.

    Raises:
        ValueError: The address is not encrypted and leaves this machine, or certificates are
            missing.
    """
    scheme, found, rest = address.partition("://")
    if not found:
        scheme, rest = "tcp", address
    host, port_found, port = rest.rpartition(":")
    if not (port_found and host and port.isdigit()):
        raise ValueError(f"scheduler must look like tls://host:8786, got {address!r}")
    if scheme == "tls":
        if certificates is None:
            raise ValueError("a tls:// scheduler needs --tls-ca, --tls-cert and --tls-key")
    elif scheme != "tcp":
        raise ValueError(f"scheduler must be a tls:// address, got {address!r}")
    elif not _is_loopback(host):
        raise ValueError(
            f"scheduler {address} is not encrypted: dask sends pickled code, so whoever reaches "
            "that port runs programs as you; use tls:// with certificates"
        )


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


@dataclass(frozen=True, kw_only=True)
class DaskEngine:
    """Workers of a dask scheduler; a killed worker's batch goes to another one.

    The batches are dask's own and not those of joblib's backend for dask, which waits for ever for
    a run that ended every worker (joblib 1.6): its future fails without a callback.

    Without an address a scheduler with workers is started on this machine, with TLS and
    certificates that live as long as it does. Those workers keep each run in the store at once.
    Workers of a foreign scheduler may have no part in the store's disk: they send their batches
    here.
    """

    processes: int = 2  # Workers on this machine, where there is no address
    address: str | None = None  # Scheduler that is running already
    certificates: Certificates | None = None  # For its TLS connection

    def __post_init__(self) -> None:
        if self.processes < 1:
            raise ValueError(f"processes must be at least 1, got {self.processes}")
        if self.address is not None:
            refuse_open_scheduler(self.address, self.certificates)

    def wind(self, runs: Mapping[str, PlannedRun], store: RunStore) -> Iterator[tuple[str, Arrays]]:
        """Wind runs; see `Engine.wind`.

        Raises:
            EngineError: dask is not installed, the scheduler does not answer or is lost, or
                every worker dies on the same run.
        """
        with self._client() as client:
            shared = store if self.address is None else None
            for key, found in _wind_with(client, runs, shared):
                if shared is None:
                    store.save(key, found)
                yield key, found

    @contextlib.contextmanager
    def _client(self) -> Iterator[Any]:
        dask = _library()
        # What is lost is reported in one sentence; the library would log a traceback.
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        with contextlib.ExitStack() as stack:
            if self.address is None:
                security = dask.Security.temporary()
                target = stack.enter_context(
                    dask.LocalCluster(
                        n_workers=self.processes,
                        threads_per_worker=1,
                        security=security,
                        dashboard_address=LOOPBACK,
                        silence_logs=logging.CRITICAL,
                    )
                )
            else:
                target, security = self.address, _security(dask, self.certificates)
            try:
                client = stack.enter_context(
                    dask.Client(
                        target, security=security, timeout=CONNECT_TIME, set_as_default=False
                    )
                )
                client.wait_for_workers(1, timeout=CONNECT_TIME)
            except (OSError, TimeoutError) as error:
                raise EngineError(
                    f"scheduler {self.address or 'of this machine'} does not answer or has no "
                    f"worker: {' '.join(str(error).split())}"
                ) from error
            yield client


def _library() -> Any:
    try:
        # An extra of the project: only who asks for a cluster needs it.
        import distributed  # noqa: PLC0415
    except ImportError as error:
        raise EngineError(
            "engine dask needs the extra `cluster`: pip install 'cable-winding-twin[cluster]'"
        ) from error
    return distributed


def _security(dask: Any, certificates: Certificates | None) -> Any:
    if certificates is None:
        return None
    return dask.Security(
        tls_ca_file=str(certificates.authority),
        tls_client_cert=str(certificates.certificate),
        tls_client_key=str(certificates.key),
        require_encryption=True,
    )


def _wind_with(
    client: Any, runs: Mapping[str, PlannedRun], store: RunStore | None
) -> Iterator[tuple[str, Arrays]]:
    dask = _library()
    pending: dict[str, list[tuple[str, PlannedRun]]] = {}

    def submit(batch: list[tuple[str, PlannedRun]]) -> Any:
        future = client.submit(wind_batch, batch, store, solver_version(), None, pure=False)
        pending[future.key] = batch
        return future

    workers = max(1, sum(client.nthreads().values()))
    lost = []
    completed = dask.as_completed(
        [submit(batch) for batch in batches(runs, workers)], loop=client.loop
    )
    for future in completed:
        batch = pending.pop(future.key)
        if future.status == "cancelled":
            raise EngineError("the scheduler is gone, and with it what was on its way")
        failure = future.exception()
        if failure is None:
            yield from future.result()
        elif not isinstance(failure, dask.KilledWorker):
            raise failure
        elif len(batch) > 1:
            # One by one, so that a run that kills its worker takes no other with it.
            completed.update([submit([pair]) for pair in batch])
        else:
            lost += batch
    if lost:
        raise EngineError(
            f"{len(lost)} runs ended their worker again and again, perhaps for want of memory"
        )


@dataclass(frozen=True, kw_only=True)
class Shard:
    """One of several disjoint parts of a sweep."""

    number: int = 1  # Which part, from 1
    count: int = 1  # How many parts there are

    def __post_init__(self) -> None:
        if not 1 <= self.number <= self.count:
            raise ValueError(
                f"shard must be k/N with k from 1 to N, got {self.number}/{self.count}"
            )

    @classmethod
    def parse(cls, text: str) -> Shard:
        """Read k/N.

        Raises:
            ValueError: The text is something else.
        """
        number, _, count = text.partition("/")
        if not (number.isdecimal() and count.isdecimal()):
            raise ValueError(f"shard must be k/N with k from 1 to N, got {text!r}")
        return cls(number=int(number), count=int(count))

    def keys(self, keys: Sequence[str]) -> tuple[str, ...]:
        """Return this part's keys: of the different ones, every count-th in order."""
        return tuple(dict.fromkeys(keys))[self.number - 1 :: self.count]


def stored_results(
    store: RunStore, keys: Sequence[str], say: Callable[[str], None]
) -> dict[str, Arrays]:
    """Return the results of the keys that are in a store."""
    found = {key: store.load(key, say) for key in dict.fromkeys(keys)}
    return {key: results for key, results in found.items() if results is not None}


def wind_missing(
    runs: Mapping[str, PlannedRun],
    done: Mapping[str, Arrays],
    *,
    engine: Engine,
    store: RunStore,
    ended: Callable[[Arrays], None],
) -> dict[str, Arrays]:
    """Wind the runs that are not done and return the results of all.

    Args:
        runs: Runs by key.
        done: Results that are there already.
        engine: Who winds.
        store: Where each result is kept as soon as it is there.
        ended: Called in this process with the results of each run.

    Raises:
        EngineError: The engine cannot go on; what is stored stays stored.
        SolverMismatchError: A worker has another solver.
        OSError: The store cannot be written.
    """
    results = dict(done)
    missing = {key: run for key, run in runs.items() if key not in done}
    if missing:
        for key, found in engine.wind(missing, store):
            results[key] = found
            ended(found)
    return results
