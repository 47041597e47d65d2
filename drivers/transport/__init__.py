"""Ports and buses: how bytes and frames reach a driver."""
