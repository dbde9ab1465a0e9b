"""What a user can get wrong: each error's message is one line that names the key and the remedy."""


class ConfigError(Exception):
    """A configuration that cannot be used."""


class FailedRunsError(Exception):
    """A campaign that more runs failed of than is allowed."""


class DataError(Exception):
    """Files a stage cannot use."""
