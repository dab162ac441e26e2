#!/usr/bin/env python3
"""Writes the bill of materials of the programs as CycloneDX 1.5 JSON, from `cargo metadata` and Cargo.lock.

Usage: sbom.py TARGET PACKAGE… > FILE
"""

import json
import subprocess
import sys
import tomllib
import uuid

target, names = sys.argv[1], sys.argv[2:]
command = ["cargo", "metadata", "--locked", "--format-version", "1", "--filter-platform", target]
metadata = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
packages = {package["id"]: package for package in metadata["packages"]}
nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
with open("Cargo.lock", "rb") as file:
    locked = tomllib.load(file)["package"]
checksums = {(package["name"], package["version"]): package.get("checksum") for package in locked}


def below(identity):
    """What a package is built of: its own dependencies and what runs while it is built, not what only its tests need."""
    kinds = lambda dependency: {kind["kind"] for kind in dependency["dep_kinds"]}
    return sorted(dependency["pkg"] for dependency in nodes[identity]["deps"] if kinds(dependency) - {"dev"})


def reference(identity):
    package = packages[identity]
    return f"pkg:cargo/{package['name']}@{package['version']}"


def component(identity):
    package = packages[identity]
    found = {
        "type": "application" if package["name"] in names else "library",
        "bom-ref": reference(identity),
        "name": package["name"],
        "version": package["version"],
        "purl": reference(identity),
    }
    if package["license"]:
        found["licenses"] = [{"expression": package["license"].replace("/", " OR ")}]
    if checksum := checksums.get((package["name"], package["version"])):
        found["hashes"] = [{"alg": "SHA-256", "content": checksum}]
    return found


top = sorted(identity for identity, package in packages.items() if package["name"] in names and not package["source"])
needed, left = set(), list(top)
while left:
    identity = left.pop()
    if identity not in needed:
        needed.add(identity)
        left += below(identity)
version = packages[top[0]]["version"]
whole = f"pkg:generic/goniod@{version}"
everything = sorted(needed, key=reference)
serial = uuid.uuid5(uuid.NAMESPACE_URL, "\n".join(map(reference, everything)))
json.dump(
    {
        "$schema": "http://cyclonedx.org/schema/bom-1.5.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "serialNumber": f"urn:uuid:{serial}",
        "version": 1,
        "metadata": {"component": {"type": "application", "bom-ref": whole, "name": "goniod", "version": version}},
        "components": [component(identity) for identity in everything],
        "dependencies": [{"ref": whole, "dependsOn": [reference(identity) for identity in top]}]
        + [{"ref": reference(identity), "dependsOn": sorted(set(map(reference, below(identity))))} for identity in everything],
    },
    sys.stdout,
    indent=1,
)
