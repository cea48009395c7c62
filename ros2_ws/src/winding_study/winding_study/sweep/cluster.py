"""Sweeps over several machines with dask.distributed, encrypted, or over this one."""

from __future__ import annotations

import contextlib
import ipaddress
import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cable_fem_node.winding.prediction import PlannedRun
from winding_study.runs.run_store import Arrays, RunStore
from winding_study.runs.solver_version import solver_version
from winding_study.sweep.engines import EngineError, batches
from winding_study.sweep.outcome import wind_batch

# Time for a scheduler to answer and to have its first worker [s].
CONNECT_TIME = 20.0

# Where the status page of a scheduler of this machine listens: any free port, for nobody else.
LOOPBACK = "127.0.0.1:0"


@dataclass(frozen=True, kw_only=True)
class Certificates:
    """Files of a TLS connection, all in PEM.

    Attributes:
        authority: Certificate that signed both sides' certificates.
        certificate: This side's certificate.
        key: Its private key.
    """

    authority: Path
    certificate: Path
    key: Path

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

    Without an address a scheduler with workers is started on this machine, with TLS and
    certificates that live as long as it does. Those workers keep each run in the store at once.
    Workers of a foreign scheduler may have no part in the store's disk: they send their batches
    here.

    Attributes:
        processes: Workers on this machine, where there is no address.
        address: Scheduler that is running already.
        certificates: For its TLS connection.
    """

    processes: int = 2
    address: str | None = None
    certificates: Certificates | None = None

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
        # What is lost is said in one sentence; the library's own way is a traceback.
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
