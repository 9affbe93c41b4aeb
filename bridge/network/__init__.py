"""Zenoh: sessions, keys, messages, access control."""
