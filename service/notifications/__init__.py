"""Telling others of alerts: the outbox, webhooks, their deliveries and secrets."""
