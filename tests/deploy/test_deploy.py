"""What ``deploy/`` holds passes its linters and schemas, and calls the command line as it is."""

from __future__ import annotations

import os
import re
import shlex
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import kubernetes_validate
import pytest
import typer
import yaml

from carstage.cli.app import app

DEPLOY = Path(__file__).parents[2] / "deploy"
PROGRAMS = Path(sys.executable).parent

#: Fields that the definitions of KubeRay (ray.io/v1) list, and of Argo's those in use.
FIELDS = {
    "RayJob": """
        activeDeadlineSeconds backoffLimit clusterSelector deletionStrategy entrypoint
        entrypointNumCpus entrypointNumGpus entrypointResources jobId managedBy metadata
        preRunningDeadlineSeconds rayClusterSpec runtimeEnvYAML shutdownAfterJobFinishes
        submissionMode submitterConfig submitterPodTemplate suspend ttlSecondsAfterFinished
    """,
    "RayCluster": """
        authOptions autoscalerOptions enableInTreeAutoscaling gcsFaultToleranceOptions headGroupSpec
        headServiceAnnotations managedBy rayVersion suspend upgradeStrategy workerGroupSpecs
    """,
    "HeadGroup": """
        enableIngress headService labels rayStartParams resources serviceType template
    """,
    "WorkerGroup": """
        groupName idleTimeoutSeconds labels maxReplicas minReplicas numOfHosts rayStartParams
        replicas resources scaleStrategy suspend template
    """,
    "Template": "name steps inputs retryStrategy container",
}
WORKER_GROUP_NEEDS = {"groupName", "maxReplicas", "minReplicas", "template"}


def fields(kind: str) -> set[str]:
    return set(FIELDS[kind].split())


def documents(name: str) -> list[dict[str, Any]]:
    return [one for one in yaml.safe_load_all((DEPLOY / name).read_text()) if one]


def validate_pod(pod: dict[str, Any]) -> None:
    """A pod's specification against the schema of Kubernetes, nothing unknown in it."""
    whole = {"apiVersion": "v1", "kind": "Pod", "metadata": {"name": "pod"}, "spec": pod}
    kubernetes_validate.validate(whole, "1.37", strict=True)


@pytest.fixture
def called(tmp_path: Path) -> tuple[dict[str, str], Path]:
    """An environment whose ``carstage`` writes down its arguments, one a line; and where."""
    program = tmp_path / "carstage"
    program.write_text('#!/bin/sh\nprintf "%s\\n" "$@" > "$0.txt"\n')
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    return {"PATH": f"{tmp_path}:{os.environ['PATH']}"}, tmp_path / "carstage.txt"


def test_the_container_file_passes_its_linter() -> None:
    subprocess.run([PROGRAMS / "hadolint", DEPLOY / "Containerfile"], check=True)


def test_the_container_file_installs_the_pinned_versions(tmp_path: Path) -> None:
    text = (DEPLOY / "Containerfile").read_text()
    found = re.search(r'python -c "(.*?)" >', text)
    assert found is not None
    program = found[1].replace("tomllib", "tomllib" if sys.version_info >= (3, 11) else "tomli")
    if sys.version_info < (3, 11):
        pytest.skip("the image has a newer Python, which reads TOML")
    printed = subprocess.run(
        [sys.executable, "-c", program],
        cwd=DEPLOY.parent,
        check=True,
        capture_output=True,
        text=True,
    )
    assert any(line.startswith("ray==") for line in printed.stdout.splitlines())


def test_the_script_for_slurm_passes_its_linter() -> None:
    subprocess.run([PROGRAMS / "shellcheck", DEPLOY / "slurm-array.sh"], check=True)


@pytest.mark.parametrize(("first", "number", "share"), [(1, 3, "3/4"), (0, 0, "1/4")])
def test_a_task_of_slurm_records_its_share(
    called: tuple[dict[str, str], Path], first: int, number: int, share: str
) -> None:
    environment, written = called
    slurm = {
        "SLURM_ARRAY_TASK_ID": str(number),
        "SLURM_ARRAY_TASK_MIN": str(first),
        "SLURM_ARRAY_TASK_COUNT": "4",
    }
    script = [DEPLOY / "slurm-array.sh", "a b.yaml", "out", "--retries", "5"]
    subprocess.run(script, env={**environment, **slurm}, check=True)
    assert written.read_text().splitlines() == [
        *("run", "a b.yaml", "--out", "out", "--shard", share),
        *("--workers", "auto", "--retries", "5"),
    ]


def test_the_script_for_slurm_says_how_it_is_used() -> None:
    ended = subprocess.run([DEPLOY / "slurm-array.sh"], capture_output=True, text=True)
    assert ended.returncode == 2
    assert ended.stderr.startswith("usage: ")


def test_the_job_of_kubernetes_is_valid() -> None:
    for document in documents("kubernetes-job.yaml"):
        kubernetes_validate.validate(document, "1.37", strict=True)


@pytest.mark.parametrize("index", [0, 15])
def test_a_pod_of_the_job_records_its_share(
    called: tuple[dict[str, str], Path], index: int
) -> None:
    (job,) = (one for one in documents("kubernetes-job.yaml") if one["kind"] == "Job")
    spec = job["spec"]
    (container,) = spec["template"]["spec"]["containers"]
    shares = {one["name"]: one["value"] for one in container["env"]}
    assert shares == {"SHARES": str(spec["completions"])}
    environment, written = called
    subprocess.run(
        [*container["command"], *container["args"]],
        env={**environment, **shares, "JOB_COMPLETION_INDEX": str(index)},
        check=True,
    )
    arguments = written.read_text().splitlines()
    assert arguments[arguments.index("--shard") + 1] == f"{index + 1}/16"


def test_the_job_of_ray_has_the_fields_of_its_definition() -> None:
    (job,) = documents("ray-job.yaml")
    assert (job["apiVersion"], job["kind"]) == ("ray.io/v1", "RayJob")
    assert set(job["spec"]) <= fields("RayJob")
    assert job["spec"]["submissionMode"] in {"K8sJobMode", "HTTPMode", "SidecarMode"}
    cluster = job["spec"]["rayClusterSpec"]
    assert set(cluster) <= fields("RayCluster")
    groups = [cluster["headGroupSpec"], *cluster["workerGroupSpecs"]]
    assert set(groups[0]) <= fields("HeadGroup")
    for group in groups[1:]:
        assert WORKER_GROUP_NEEDS <= set(group) <= fields("WorkerGroup")
        assert group["minReplicas"] <= group["replicas"] <= group["maxReplicas"]
    for group in groups:
        assert all(isinstance(value, str) for value in group["rayStartParams"].values())
        validate_pod(group["template"]["spec"])


def test_the_simulators_of_ray_find_place_on_its_nodes() -> None:
    (job,) = documents("ray-job.yaml")
    words = shlex.split(job["spec"]["entrypoint"])
    asked = yaml.safe_load(words[words.index("--ray-resources") + 1])
    workers = int(words[words.index("--workers") + 1])
    (group,) = job["spec"]["rayClusterSpec"]["workerGroupSpecs"]
    on_a_node = yaml.safe_load(yaml.safe_load(group["rayStartParams"]["resources"]))
    (container,) = group["template"]["spec"]["containers"]
    cores = int(container["resources"]["limits"]["cpu"])
    places = min(on_a_node["simulator"] // asked["simulator"], cores // asked["CPU"])
    assert places * group["replicas"] == workers


def test_the_workflow_of_argo_is_whole() -> None:
    (flow,) = documents("argo-workflow.yaml")
    assert (flow["apiVersion"], flow["kind"]) == ("argoproj.io/v1alpha1", "Workflow")
    templates = {one["name"]: one for one in flow["spec"]["templates"]}
    assert flow["spec"]["entrypoint"] in templates
    for template in templates.values():
        assert set(template) <= fields("Template")
        for step in (one for group in template.get("steps", ()) for one in group):
            assert step["template"] in templates
    record = templates["record"]
    validate_pod(
        {
            "containers": [{"name": "main", **record["container"]}],
            "volumes": flow["spec"]["volumes"],
        }
    )
    known = {f"inputs.parameters.{one['name']}" for one in record["inputs"]["parameters"]}
    known |= {
        f"workflow.parameters.{one['name']}" for one in flow["spec"]["arguments"]["parameters"]
    }
    used = set(re.findall(r"{{(.*?)}}", (DEPLOY / "argo-workflow.yaml").read_text()))
    assert used - {"item"} <= known


@pytest.mark.parametrize("path", sorted(DEPLOY.iterdir()), ids=lambda path: path.name)
def test_options_that_are_given_exist(path: Path) -> None:
    run: Any = typer.main.get_command(app).commands["run"]  # type: ignore[attr-defined]
    known = {option for parameter in run.params for option in parameter.opts}
    text = "\n".join(
        line for line in path.read_text().splitlines() if not line.lstrip().startswith("#")
    )
    begin = text.find("carstage run")
    if begin < 0:
        begin = text.find("- run\n")
    used = set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", text[begin:])) if begin >= 0 else set()
    assert used <= known
