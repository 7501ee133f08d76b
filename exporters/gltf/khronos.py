"""Findings of the Khronos glTF validator, where it is installed.

https://github.com/KhronosGroup/glTF-Validator
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

from exporters.findings import Finding, Severity
from exporters.node_packages import find_package

SEVERITIES: tuple[Severity, ...] = ("error", "warning", "info", "info")  # the fourth are hints

IGNORED_CODES = ("UNSUPPORTED_EXTENSION", "UNUSED_OBJECT")
"""Infos about extensions that it does not know, which are checked in `exporters.gltf.check`."""

TIMEOUT_S = 120

_SCRIPT = """
const fs = require('fs'), path = require('path'), file = process.argv[2];
require(process.argv[1]).validateBytes(new Uint8Array(fs.readFileSync(file)), {
  uri: path.basename(file), maxIssues: 100,
  externalResourceFunction: (uri) => fs.promises.readFile(
    path.join(path.dirname(file), decodeURIComponent(uri))).then((data) => new Uint8Array(data)),
}).then((report) => console.log(JSON.stringify(report)));
"""


def khronos_findings(path: Path, ktx2: frozenset[str] = frozenset()) -> list[Finding]:
    """Return findings of the Khronos validator about a file; one info where it is not installed.

    ktx2 : JSON pointers of the KTX 2 images, which it does not support
    """
    tool = find_package("gltf-validator")
    if tool is None:
        return [Finding("info", "NO_KHRONOS_VALIDATOR", "npm package gltf-validator not found, skipped", path.name)]
    command = [tool[0], "-e", _SCRIPT, str(tool[1]), str(path.resolve())]
    try:
        run = subprocess.run(command, capture_output=True, text=True, check=False, timeout=TIMEOUT_S)
    except subprocess.TimeoutExpired:
        return [Finding("warning", "KHRONOS_VALIDATOR", f"not finished within {TIMEOUT_S} s", path.name)]
    if run.returncode:
        return [Finding("warning", "KHRONOS_VALIDATOR", run.stderr.strip()[-300:], path.name)]
    return [
        Finding(
            SEVERITIES[message["severity"]],
            message["code"],
            message["message"],
            f"{path.name}: {message.get('pointer') or message.get('offset', '')}",
        )
        for message in json.loads(run.stdout)["issues"]["messages"]
        if message["code"] not in IGNORED_CODES and message.get("pointer", "").removesuffix("/mimeType") not in ktx2
    ]
