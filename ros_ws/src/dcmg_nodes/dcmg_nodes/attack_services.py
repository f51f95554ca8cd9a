"""Names of the attacker's services."""

START_SERVICE, STOP_SERVICE, LIST_SERVICE = "/attacks/start", "/attacks/stop", "/attacks/list"
