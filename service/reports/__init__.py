"""The weekly report: made, told to webhooks, mailed once."""
