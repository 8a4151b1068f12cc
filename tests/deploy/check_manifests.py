"""Checks what Kubernetes would only say when the manifests are used, and what Glint's rules for them are.

Usage: check_manifests.py GLINT FOLDER
"""
import pathlib
import re
import subprocess
import sys

import yaml


def load(folder):
    documents = []
    for path in sorted(pathlib.Path(folder).glob("*.yaml")):
        for document in yaml.safe_load_all(path.read_text()):
            documents.append((path.name, document))
    return documents


def named_ports(pod):
    return {port["name"] for container in pod["containers"] for port in container.get("ports", [])}


def check_container(container, pod, words):
    ports = {port["name"] for port in container["ports"]}
    for probe in ("readinessProbe", "livenessProbe"):
        yield f"{probe} names a port of the container", container[probe]["httpGet"]["port"] in ports
    resources = container["resources"]
    yield "memory is limited", "memory" in resources["limits"]
    yield "memory and processors are asked for", {"cpu", "memory"} <= set(resources["requests"])
    context = container["securityContext"]
    yield "no privileges", context["allowPrivilegeEscalation"] is False
    yield "its own files are read-only", context["readOnlyRootFilesystem"] is True
    yield "no capabilities", context["capabilities"]["drop"] == ["ALL"]
    volumes = {volume["name"] for volume in pod["volumes"]}
    mounts = container["volumeMounts"]
    yield "mounts are volumes of the pod", {mount["name"] for mount in mounts} == volumes
    paths = [mount["mountPath"] for mount in mounts]
    for argument in container.get("args", [])[1:]:
        word, _, value = argument.partition("=")
        yield f"glint has the word {word}", word in words[container["args"][0]]
        if value.startswith("/"):
            yield f"{value} is mounted", any(value.startswith(path) for path in paths)


def check_deployment(document, words):
    spec = document["spec"]
    pod = spec["template"]["spec"]
    labels = spec["template"]["metadata"]["labels"]
    yield "it selects its own pods", spec["selector"]["matchLabels"].items() <= labels.items()
    yield "no account of the cluster", pod["automountServiceAccountToken"] is False
    yield "not as root", pod["securityContext"]["runAsNonRoot"] is True
    yield "system calls are filtered", pod["securityContext"]["seccompProfile"]["type"] == "RuntimeDefault"
    for container in pod["containers"]:
        yield from check_container(container, pod, words)


def check_service(document, deployments):
    selector = document["spec"]["selector"]
    pods = [d["spec"]["template"] for d in deployments if selector.items() <= d["spec"]["template"]["metadata"]["labels"].items()]
    yield "it selects one deployment", len(pods) == 1
    for port in document["spec"]["ports"]:
        yield f"port {port['targetPort']} is there", port["targetPort"] in named_ports(pods[0]["spec"])


def words_of(glint, command):
    text = subprocess.run([glint, command, "--help"], check=True, capture_output=True, text=True).stdout
    return set(re.findall(r"--[a-z-]+", text))


def main(glint, folder):
    words = {command: words_of(glint, command) for command in ("serve", "worker")}
    documents = load(folder)
    deployments = [document for _, document in documents if document["kind"] == "Deployment"]
    failures = [] if len(deployments) == 3 else ["there are not three deployments"]
    for name, document in documents:
        checks = []
        if document["kind"] == "Deployment":
            checks = check_deployment(document, words)
        elif document["kind"] == "Service":
            checks = check_service(document, deployments)
        failures += [f"{name}: {document['metadata']['name']}: not so: {what}" for what, holds in checks if not holds]
    print("\n".join(failures))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
