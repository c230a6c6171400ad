"""Dask's workers on other machines: three network namespaces of this one, where root may make them."""

import contextlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from posefit.sweep.ledger import Ledger
from tests.sweep.fake import SLOW, STARTS, cells, starts
from tests.sweep.test_chaos import wait_for

ROOT = Path(__file__).parents[2]
COUNT = 60
SCHEDULER = "tcp://10.87.0.1:8786"
NAMES = [f"posefit-{os.getpid()}-{k}" for k in range(3)]  # the scheduler's and the driver's host, and two of workers

pytestmark = pytest.mark.slow
quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True)


class Hosts:
    """Three hosts on one network, a bridge in the first; what was started on them ends with them."""

    def __init__(self, folder: Path) -> None:
        self._environment = {**os.environ, STARTS: str(folder / "starts"), "PYTHONPATH": str(ROOT)}
        self._running: list[tuple[int, subprocess.Popen[bytes]]] = []
        for k, name in enumerate(NAMES):
            ip("netns", "add", name)
            ip("-n", name, "link", "set", "lo", "up")
            if k == 0:
                ip("-n", name, "link", "add", "bridge", "type", "bridge")
            else:
                ip("-n", NAMES[0], "link", "add", f"to-{k}", "type", "veth", "peer", "name", "wire", "netns", name)
                ip("-n", NAMES[0], "link", "set", f"to-{k}", "master", "bridge", "up")
            device = "wire" if k else "bridge"
            ip("-n", name, "addr", "add", f"10.87.0.{k + 1}/24", "dev", device)
            ip("-n", name, "link", "set", device, "up")

    def start(self, host: int, *words: str) -> subprocess.Popen[bytes]:
        """Start a Python module on a host."""
        command = ["ip", "netns", "exec", NAMES[host], sys.executable, "-m", *words]
        process = subprocess.Popen(command, cwd=ROOT, env=self._environment, start_new_session=True, **quiet)
        self._running.append((host, process))
        return process

    def worker(self, host: int) -> None:
        """Start a worker on a host."""
        address = f"10.87.0.{host + 1}"
        self.start(
            host, "distributed.cli.dask_worker", SCHEDULER, "--nthreads", "1", "--no-dashboard", "--host", address
        )

    def die(self, host: int) -> None:
        """Cut a host off, and end whatever runs there: the others hear nothing of it."""
        if host:
            ip("-n", NAMES[0], "link", "set", f"to-{host}", "down")
        listed = subprocess.run(["ip", "netns", "pids", NAMES[host]], check=True, capture_output=True, text=True)
        for process in listed.stdout.split():
            with contextlib.suppress(ProcessLookupError):
                os.kill(int(process), 9)
        for place, started in self._running:
            if place == host:
                started.wait()

    def come_back(self, host: int) -> None:
        """Connect a host again, and start its worker."""
        ip("-n", NAMES[0], "link", "set", f"to-{host}", "up")
        self.worker(host)


@pytest.fixture
def hosts(tmp_path: Path) -> Iterator[Hosts]:
    pytest.importorskip("distributed")
    if shutil.which("ip") is None or os.geteuid():
        pytest.skip("network namespaces need root and iproute2")
    try:
        made = Hosts(tmp_path)
    except subprocess.CalledProcessError as error:
        remove()
        pytest.skip(f"this system makes no network namespaces: {error.stderr.decode().strip()}")
    try:
        yield made
    finally:
        for host in range(3):
            made.die(host)
        remove()


def remove() -> None:
    for name in NAMES:
        subprocess.run(["ip", "netns", "del", name], check=False, capture_output=True)


def test_a_host_of_workers_that_dies_and_comes_back_costs_no_row(hosts: Hosts, tmp_path: Path) -> None:
    noted = tmp_path / "starts"
    hosts.start(0, "distributed.cli.dask_scheduler", "--host", "10.87.0.1", "--no-dashboard", "--no-show")
    hosts.worker(1)
    hosts.worker(2)
    driver = hosts.start(0, "tests.sweep.fake", str(tmp_path / "results"), SCHEDULER, str(COUNT), "10")
    wait_for(lambda: len({process for _, process in starts(noted)}) == 2)  # both have begun
    hosts.die(2)
    before = len(starts(noted))
    wait_for(lambda: len(starts(noted)) > before + 5)  # the other one goes on
    alive = {process for _, process in starts(noted)}
    hosts.come_back(2)
    wait_for(lambda: {process for _, process in starts(noted)} > alive)  # and both again
    assert driver.wait(timeout=600) == 1
    ledger = Ledger(tmp_path / "results")
    rows = [row["key"] for row in ledger.rows()]
    assert len(rows) == len(set(rows)) == COUNT
    assert set(rows) == {cell.key for cell in cells(COUNT, SLOW)}
    assert len(ledger.quarantined()) == 5
