"""A small study through the Slurm profile and a real Slurm: the same bytes, from few jobs."""

from __future__ import annotations

import importlib.util
import os
import secrets
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest
from studies.running import REPOSITORY, StudyRun, hashes, record, write_study

SYSTEM_CONF = Path("/etc/slurm/slurm.conf")
PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scancel", "sinfo")
PLUGIN = "snakemake_executor_plugin_cluster_generic"
STOPPING = ("slurmd", "slurmctld", "munged")
PARTITION = "all"
CPUS = 6
"""What Slurm believes the node has; a job that sleeps must not keep others waiting."""
TEMPLATE = """
ClusterName=private
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller_port}
SlurmdPort={node_port}
CommunicationParameters=NoInAddrAny,NoCtldInAddrAny
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
SchedulerParameters=sched_interval=1,sched_min_interval=0,bf_interval=1
MinJobAge=600
KillWait=2
AccountingStorageType=accounting_storage/none
MpiDefault=none
ReturnToService=2
DefMemPerCPU=500
SlurmdParameters=config_overrides
NodeName={host} NodeAddr=127.0.0.1 CPUs={cpus} RealMemory={memory_mb} State=UNKNOWN
PartitionName={partition} Nodes={host} Default=YES MaxTime=60 State=UP
"""


def missing() -> str:
    """Return why no private Slurm can be started here; empty where it can."""
    if os.geteuid() != 0:
        return "a private Slurm needs root"
    absent = [program for program in PROGRAMS if shutil.which(program) is None]
    if absent:
        return f"a private Slurm needs Debian's slurm-wlm and munge; absent: {', '.join(absent)}"
    if importlib.util.find_spec(PLUGIN) is None:
        return f"needs {PLUGIN}"
    if SYSTEM_CONF.exists() or SYSTEM_CONF.is_symlink():
        return f"this machine has a Slurm of its own: {SYSTEM_CONF}"
    return ""


class PrivateSlurm:
    """The daemons, between `start` and `stop`; all their files are below `folder`.

    folder : short enough for a socket in it (107 bytes with its name), readable by root alone.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.host = socket.gethostname().split(".")[0]

    def start(self) -> None:
        """Start munged, slurmctld and slurmd; return when the node takes jobs.

        Raises RuntimeError, with the end of the logs, where it does not within 30 s.
        """
        for name in ("state", "spool"):
            (self.folder / name).mkdir(parents=True)
        self._write_configuration()
        self._start_munge()
        _run("slurmctld", "-c")
        _run("slurmd")
        self._wait(self._idle, "the node is not idle")

    def stop(self) -> None:
        """End every job and daemon that `start` started, and remove the link; do it after any failure too."""
        if daemons := self._daemons():
            subprocess.run(["scancel", "--user=root"], check=False, capture_output=True)
            self._wait(lambda: not self.states("PENDING,RUNNING,COMPLETING"), "jobs do not end")
        for daemon in daemons:
            daemon.terminate()
        for daemon in psutil.wait_procs(daemons, 10.0)[1]:
            daemon.kill()
        if SYSTEM_CONF.is_symlink() and SYSTEM_CONF.readlink() == self._conf:
            SYSTEM_CONF.unlink()

    def states(self, states: str = "all") -> list[str]:
        """Return the state, such as COMPLETED or TIMEOUT, of every job that is in one of those."""
        return _run("squeue", "--noheader", "--format=%T", f"--states={states}").split()

    @property
    def _conf(self) -> Path:
        return self.folder / "slurm.conf"

    def _write_configuration(self) -> None:
        controller_port, node_port = _free_ports(2)
        self._conf.write_text(
            TEMPLATE.format(
                host=self.host,
                folder=self.folder,
                controller_port=controller_port,
                node_port=node_port,
                cpus=CPUS,
                memory_mb=int(_run("slurmd", "-C").split("RealMemory=")[1].split()[0]),
                partition=PARTITION,
            ),
            "utf-8",
        )
        SYSTEM_CONF.parent.mkdir(parents=True, exist_ok=True)
        SYSTEM_CONF.symlink_to(self._conf)

    def _start_munge(self) -> None:
        key = self.folder / "munge.key"
        key.write_bytes(secrets.token_bytes(128))
        key.chmod(0o600)
        self.folder.chmod(0o755)  # munged wants its socket within everyone's reach; the key stays root's
        files = {"key-file": key.name, "socket": "munge.socket", "pid-file": "munged.pid"}
        files |= {"log-file": "munged.log", "seed-file": "munged.seed"}
        _run("munged", *(f"--{word}={self.folder / name}" for word, name in files.items()))

    def _idle(self) -> bool:
        done = subprocess.run(["sinfo", "-h", "-o", "%T"], capture_output=True, text=True, check=False)
        return done.stdout.strip() == "idle"

    def _wait(self, ready: Callable[[], bool], failure: str, seconds: float = 30.0) -> None:
        until = time.monotonic() + seconds
        while not ready():
            if time.monotonic() > until:
                logs = "\n".join(path.read_text("utf-8")[-2000:] for path in self.folder.glob("*.log"))
                raise RuntimeError(f"private Slurm: {failure} after {seconds:.0f} s\n{logs}")
            time.sleep(0.2)

    def _daemons(self) -> list[psutil.Process]:
        """Daemons of ours that live."""
        files = (self.folder / f"{name}.pid" for name in STOPPING)
        pids = [int(file.read_text() or 0) for file in files if file.is_file()]
        return [psutil.Process(pid) for pid in pids if pid and psutil.pid_exists(pid)]


def _run(*words: str) -> str:
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)} ended with {done.returncode}: {done.stderr.strip()}")
    return done.stdout


def _free_ports(count: int) -> list[int]:
    """Ports that nothing listens on now, all different."""
    sockets = [socket.socket() for _ in range(count)]
    for each in sockets:
        each.bind(("127.0.0.1", 0))
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports


pytestmark = pytest.mark.slurm


def _study(folder: Path) -> StudyRun:
    """Write two subjects' right hands, a second of each of two tasks, and two models."""
    folder.mkdir(parents=True)
    rows = []
    for subject in ("01", "02"):
        for task, role in (("rom", "calibration"), ("opposition", "evaluation")):
            file = record(folder / f"{subject}-{task}.parquet", subject=subject, task=task)
            rows.append(f"{subject}\tright\t{task}\t{role}\t{file.name}")
    return write_study(folder, "same", rows, ["paper-fig3-rest", "paper-fig4"])


def test_results_are_those_of_a_laptop_from_few_jobs(tmp_path: Path) -> None:
    """One Slurm job a subject and one for the study, and every byte the same."""
    if reason := missing():
        pytest.skip(reason)
    local, study = _study(tmp_path / "local"), _study(tmp_path / "study")
    local.run()
    profile = ["--workflow-profile", str(REPOSITORY / "profiles" / "slurm")]
    with tempfile.TemporaryDirectory(prefix="slurm-") as name:
        slurm = PrivateSlurm(Path(name))
        try:
            slurm.start()
            faster = ["--seconds-between-status-checks", "1", "--latency-wait", "15"]
            done = study.snakemake(*profile, *faster, cores=1)
            assert done.returncode == 0, done.stderr
            assert slurm.states() == ["COMPLETED"] * 3
        finally:
            slurm.stop()
    assert hashes(study.results.folder) == hashes(local.results.folder)
