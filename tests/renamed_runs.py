"""Runs under other names, for pages that must tell runs apart and trust no name."""

from __future__ import annotations

import dataclasses

from physique.runs.run import Run

EVIL = "</script><script>alert(1)</script><img src=x onerror=alert(1)>&\"'"


def renamed(run: Run, *, clip: str = "walk", body: str = "average") -> Run:
    identity = {**run.record["identity"], "clip": clip}
    record = {**run.record, "identity": identity, "clip_source": clip}
    return dataclasses.replace(run, record=record, body=dataclasses.replace(run.body, name=body))
