"""Errors of a run over several hosts: one line each."""

from __future__ import annotations

from dcmg.errors import CommandError


class HostsError(CommandError):
    """A host cannot take part; the message names it."""


class ChannelError(HostsError):
    """The other end of a channel is gone, is silent, or is not who it must be."""
